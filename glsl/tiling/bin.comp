// Puts every particle at the head of the list of each tile that it covers, by atomic exchange. One thread a particle.
// Lists come out in arbitrary order; order.comp sorts them. Yusov 5.3, step 1.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tiling/tile.glsl"
#include "tiling/occluder.glsl"
#include "grid/counters.glsl"
#include "compact/index.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer TilingParamsBuffer { TilingParams tiling; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 2, std430) restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 3, std430) restrict buffer TileHeads { uint head[]; } tile_heads; // cleared to NO_NODE
layout(set = 0, binding = 4, std430) writeonly restrict buffer TileNodes { TileNode node[]; } tile_nodes;
layout(set = 0, binding = 5, std430) writeonly restrict buffer Occluders { Occluder by[]; } occluders;

void main() {
    uint index = linear_index();
    if (index >= counters.count.stored) return;
    Particle p = particles.particle[index];
    occluders.by[index] = occluder_of(p, params.tiling);
    uint key = light_key(light_depth(p.centre, params.tiling));
    for (uint level = 0u; level < params.tiling.level_count; ++level) {
        if (!in_level(p, level, params.tiling)) continue;
        vec4 covered = footprint(p, level, params.tiling);
        TileRange tiles = footprint_tiles(covered, params.tiling);
        ivec2 size = max(tiles.greatest - tiles.least + 1, ivec2(0));
        uint needed = uint(size.x * size.y);
        if (needed == 0u) continue;
        uint slot = atomicAdd(counters.count.tile_nodes, needed); // counts past capacity
        for (int v = tiles.least.y; v <= tiles.greatest.y; ++v) {
            for (int u = tiles.least.x; u <= tiles.greatest.x; ++u, ++slot) {
                if (slot >= params.tiling.node_capacity) continue;
                uint tile = tile_index(ivec2(u, v), level, params.tiling);
                tile_nodes.node[slot] = TileNode(
                    atomicExchange(tile_heads.head[tile], slot), pack_bounds(covered, ivec2(u, v)), index, key);
            }
        }
    }
}
