#version 460
#extension GL_GOOGLE_include_directive : require
// A quad around the silhouette of each visible particle, in drawing order. No attributes: four vertices an instance.
#include "blend/ellipsoid.glsl"
layout(binding = 0, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 1, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 2, std430) restrict readonly buffer Order { uint indices[]; } order;
layout(location = 0) flat out uint particle_index;

void main() {
    particle_index = order.indices[gl_InstanceIndex];
    vec4 bounds = screen_bounds(frame.params, particles.elements[particle_index]);
    vec2 corner = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1);
    vec2 ndc = bounds.x > bounds.z ? vec2(2.0) : mix(bounds.xy, bounds.zw, corner);
    gl_Position = vec4(ndc.x, -ndc.y, 0.5, 1.0);
}
