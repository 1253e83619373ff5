#version 460
// Stores f32 numbers into an image of any format.
#extension GL_GOOGLE_include_directive : require
#include "conform/blocks.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(binding = 0, std430) restrict readonly buffer StoreSource { vec4 value[]; } source;
layout(binding = 1) restrict writeonly uniform image2D target;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(target);
    if (any(greaterThanEqual(texel, size))) return;
    if (SABOTAGE == BROKEN_LOST && texel == size / 2) return;
    vec4 value = source.value[texel.y * size.x + texel.x];
    imageStore(target, texel, SABOTAGE == BROKEN_REVERSED ? -value : value);
}
