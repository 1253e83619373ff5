#version 460
// Fills a level of the scattering table that was not solved: a cubic in the logarithm of the optical radius through four
// levels that were, texel by texel. In, out: `table`, other levels of it.
#extension GL_GOOGLE_include_directive : require
#include "lut/scattering_lookup.glsl"

layout(local_size_x = 64) in;
layout(binding = 0, rg16f) restrict uniform image3D table;
layout(push_constant) uniform BetweenPush { uvec4 levels; vec4 weights; uint level; };

void main() {
    ivec3 size = imageSize(table), texel = ivec3(gl_GlobalInvocationID);
    int n_mu = size.z / int(SCATTERING_LEVELS);
    if (any(greaterThanEqual(texel, ivec3(size.xy, n_mu)))) return;
    vec2 sum = vec2(0.0);
    for (int k = 0; k < 4; ++k) {
        sum += weights[k] * imageLoad(table, texel + ivec3(0, 0, int(levels[k]) * n_mu)).xy;
    }
    imageStore(table, texel + ivec3(0, 0, int(level) * n_mu), vec4(sum, 0.0, 0.0));
}
