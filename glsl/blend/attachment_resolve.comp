#version 460
#extension GL_GOOGLE_include_directive : require
// Turns the state that `attachment:K` leaves in its attachments into the cloud targets that every mode writes. Beyond the
// 1 + K + K/2 attachments of a smaller window any image is bound, and not read.
layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 2) const uint WINDOW = 4;   // 1, 2 or 4
#include "blend/window.glsl"
layout(binding = 0) uniform sampler2D state_0;   // radiance, Σ optical depth
layout(binding = 1) uniform sampler2D state_1;   // colour, optical depth: WINDOW times; then ends of two segments each
layout(binding = 2) uniform sampler2D state_2;
layout(binding = 3) uniform sampler2D state_3;
layout(binding = 4) uniform sampler2D state_4;
layout(binding = 5) uniform sampler2D state_5;
layout(binding = 6) restrict writeonly uniform image2D cloud;      // in-scattered radiance, transmittance
layout(binding = 7) restrict writeonly uniform image2D nearest;    // distance to the first cloud [m]

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(cloud)))) return;
    vec4 c = texelFetch(state_0, pixel, 0), ends;
    vec4 colours[4];
    colours[0] = texelFetch(state_1, pixel, 0);
    if (WINDOW > 1u) colours[1] = texelFetch(state_2, pixel, 0);
    if (WINDOW > 2u) {
        colours[2] = texelFetch(state_3, pixel, 0);
        colours[3] = texelFetch(state_4, pixel, 0);
    }
    if (WINDOW == 1u) ends = texelFetch(state_2, pixel, 0);
    else if (WINDOW == 2u) ends = texelFetch(state_3, pixel, 0);
    else ends = texelFetch(state_5, pixel, 0);
    Segment window[WINDOW];
    [[unroll]] for (uint i = 0u; i < WINDOW; ++i) window[i] = Segment(colours[i].rgb, colours[i].a, 0.0, 0.0);
    imageStore(cloud, pixel, vec4(resolve_window(window, Committed(c.rgb, c.a)), exp(-c.a)));
    imageStore(nearest, pixel, vec4(colours[0].a > 0.0 ? ends.x : 1e30));
}
