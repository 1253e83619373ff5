#version 460
#extension GL_GOOGLE_include_directive : require
// Scene radiance → what a display shows: exposure, tone curve, sRGB encoding.
#include "film/tonemap.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D scene;
layout(binding = 1) restrict writeonly uniform image2D picture;
layout(push_constant) uniform TonemapPush {
    vec3 gain;  // exposure and white balance
    uint curve;
};

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(picture)))) return;
    imageStore(picture, pixel, vec4(display_value(texelFetch(scene, pixel, 0).rgb, gain, curve), 1.0));
}
