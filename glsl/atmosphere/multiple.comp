#version 460
#extension GL_GOOGLE_include_directive : require
// Multiply scattered radiance per unit of solar irradiance [1/sr] by (mu_s, h); once per air. Cost: 64 × 24 steps a texel.
#include "atmosphere/luts.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, std430) restrict readonly buffer Air { AirParams params; } air;
layout(binding = 1) uniform sampler2D transmittance_lut;
layout(binding = 2, rgba16f) restrict writeonly uniform image2D table;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(table);
    if (any(greaterThanEqual(texel, size))) return;
    imageStore(table, texel, vec4(multiple_texel(transmittance_lut, air.params, texel, size), 1.0));
}
