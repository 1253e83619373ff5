#version 460
#extension GL_GOOGLE_include_directive : require
// Fills the tile of billow noise, once per device. 64³ texels; rgba16f: gradient [1/cell] in xyz, value in w.
#include "detail/billow.glsl"
layout(local_size_x = 4, local_size_y = 4, local_size_z = 4) in;
layout(binding = 0, rgba16f) restrict writeonly uniform image3D tile;

void main() {
    ivec3 texel = ivec3(gl_GlobalInvocationID), size = imageSize(tile);
    if (any(greaterThanEqual(texel, size))) return;
    imageStore(tile, texel, billow((vec3(texel) + 0.5) / vec3(size) * float(BILLOW_CELLS)));
}
