#version 460
#extension GL_GOOGLE_include_directive : require
// Mode `tiled`: one pair for every particle and tile that it touches, in the order of particles.
#include "blend/tile_particle.glsl"
#include "blend/tiled_use.glsl"
#include "compact/index.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer TiledUseBuffer { TiledUse value; } tiled_use;
layout(binding = 1, std430) restrict readonly buffer TileParticles { TileParticle element[]; } tile_particles;
layout(binding = 2, std430) restrict readonly buffer Firsts { uint first[]; } firsts;   // prefix sum of the counts
layout(binding = 3, std430) restrict writeonly buffer PairTiles { uint tile[]; } pair_tiles;
layout(binding = 4, std430) restrict writeonly buffer PairParticles { uint element[]; } pair_particles;
layout(push_constant) uniform TiledEmitPush { ivec2 tiles; uint capacity; } push;

void main() {
    uint i = linear_index();
    if (i >= tiled_use.value.particles) return;
    TileParticle t = tile_particles.element[i];
    ivec4 range = tile_range(t, push.tiles);
    uint at = firsts.first[i];
    for (int y = range.y; y <= range.w; ++y)
        for (int x = range.x; x <= range.z; ++x)
            if (touches(t, ivec2(x, y)) && at < push.capacity) {
                pair_tiles.tile[at] = uint(y * push.tiles.x + x);
                pair_particles.element[at] = i;
                ++at;
            }
}
