#version 460
// Loads the texels of an r16f image as f32.
#extension GL_GOOGLE_include_directive : require
#include "conform/blocks.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(binding = 0, r16f) restrict readonly uniform image2D source;
layout(binding = 1, std430) restrict writeonly buffer LoadValues { uint bits[]; } values;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(source);
    if (any(greaterThanEqual(texel, size))) return;
    ivec2 from = SABOTAGE == BROKEN_REVERSED ? size - 1 - texel : texel;
    float value = imageLoad(source, from).x;
    values.bits[texel.y * size.x + texel.x] = SABOTAGE == BROKEN_LOST && texel == size * 3 / 4 ? 0u : floatBitsToUint(value);
}
