#version 460
// Samples the density profile on a cubic lattice of points, so that the rays of the optical depth table need no noise.
// Out: `volume`, r16f, density 0..1 at texel centres spanning [-1, 1]³. Cost: one noise evaluation a texel.
#extension GL_GOOGLE_include_directive : require
#include "lut/profile.glsl"

layout(local_size_x = 4, local_size_y = 4, local_size_z = 4) in;
layout(binding = 0, r16f) restrict writeonly uniform image3D volume;
layout(push_constant) uniform ProfilePush { uint style; uint seed; };

void main() {
    ivec3 texel = ivec3(gl_GlobalInvocationID), size = imageSize(volume);
    if (any(greaterThanEqual(texel, size))) return;
    vec3 p_us = (vec3(texel) + 0.5) * (2.0 / vec3(size)) - 1.0;
    imageStore(volume, texel, vec4(profile_density(p_us, style, seed)));
}
