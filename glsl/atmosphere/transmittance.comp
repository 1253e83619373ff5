#version 460
#extension GL_GOOGLE_include_directive : require
// Transmittance to the top of the atmosphere [1] by (mu, h); once per air. Cost: 2 × 48 density samples a texel.
#include "atmosphere/luts.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, std430) restrict readonly buffer Air { AirParams params; } air;
layout(binding = 1, rgba16f) restrict writeonly uniform image2D table;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(table);
    if (any(greaterThanEqual(texel, size))) return;
    imageStore(table, texel, vec4(transmittance_texel(air.params, texel, size), 1.0));
}
