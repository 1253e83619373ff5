#version 460
#extension GL_GOOGLE_include_directive : require
// Turns the window that `interlock:K` leaves in each pixel into the cloud targets that every mode writes.
layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 2) const uint WINDOW = 2;
#include "blend/window.glsl"
layout(binding = 0, rgba32f) restrict readonly uniform image2DArray window_state;
layout(binding = 1) restrict writeonly uniform image2D cloud;      // in-scattered radiance, transmittance
layout(binding = 2) restrict writeonly uniform image2D nearest;    // distance to the first cloud [m]

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(window_state).xy))) return;
    vec4 c = imageLoad(window_state, ivec3(pixel, 0));
    Segment window[WINDOW];
    [[unroll]] for (int i = 0; i < int(WINDOW); ++i) {
        vec4 colour = imageLoad(window_state, ivec3(pixel, 1 + i));
        window[i] = Segment(colour.rgb, colour.a, 0.0, 0.0);
    }
    float t_enter = imageLoad(window_state, ivec3(pixel, 1 + int(WINDOW))).x;
    imageStore(cloud, pixel, vec4(resolve_window(window, Committed(c.rgb, c.a)), exp(-c.a)));
    imageStore(nearest, pixel, vec4(window[0].optical_depth > 0.0 ? t_enter : 1e30));
}
