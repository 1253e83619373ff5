#version 460
#extension GL_GOOGLE_include_directive : require
// vertex: blend/particle.vert
// lighting: each
// Mode `alpha`: sorted alpha blending by fixed function, the fallback that runs anywhere. Overlap is ignored: each
// particle lies wholly in front of those drawn before it.
#include "blend/bindings.glsl"
#include "blend/segment.glsl"
layout(location = 0) flat in uint particle_index;
layout(location = 0) out vec4 cloud;      // C (1 - T), T: blended as rgb + a · destination, a · destination
layout(location = 1) out float nearest;   // blended as minimum [m]

void main() {
    Segment s = particle_segment(particle_index, gl_FragCoord.xy);
    if (s.optical_depth <= 0.0) discard;
    cloud = vec4(s.colour * opacity(s.optical_depth), exp(-s.optical_depth));
    nearest = s.t_enter;
}
