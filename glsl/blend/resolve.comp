#version 460
#extension GL_GOOGLE_include_directive : require
// Turns the state that `interlock` leaves in each pixel into the cloud targets that every mode writes.
#include "blend/merge.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, rgba32f) restrict readonly uniform image2D committed_state;
layout(binding = 1, rgba32f) restrict readonly uniform image2D pending_state;
layout(binding = 2, rg32f) restrict readonly uniform image2D extent_state;
layout(binding = 3) restrict writeonly uniform image2D cloud;      // in-scattered radiance, transmittance
layout(binding = 4) restrict writeonly uniform image2D nearest;    // distance to the first cloud [m]

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(committed_state)))) return;
    vec4 c = imageLoad(committed_state, pixel);
    vec4 p = imageLoad(pending_state, pixel);
    vec2 extent = imageLoad(extent_state, pixel).xy;
    Segment pending = Segment(p.rgb, p.a, extent.x, extent.y);
    imageStore(cloud, pixel, vec4(resolve_radiance(pending, Committed(c.rgb, c.a)), exp(-c.a)));
    imageStore(nearest, pixel, vec4(p.a > 0.0 ? extent.x : 1e30));
}
