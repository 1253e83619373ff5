#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_fragment_shader_interlock : require
// vertex: tiling/insert.vert
// Inserts a particle at the head of one tile's list. VK_EXT_fragment_shader_interlock keeps the order of the draw within
// each tile (Yusov 5.3), so lists come out front to back along the light with no sorting of their own.
#include "tiling/params.glsl"
#include "tiling/tile.glsl"
#include "grid/counters.glsl"
layout(pixel_interlock_ordered) in;
layout(set = 0, binding = 0, std430) readonly restrict buffer TilingParamsBuffer { TilingParams tiling; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 3, std430) restrict buffer CountersBuffer { Counters count; } counters;
// `coherent`: the interlock orders accesses, it does not make them visible.
layout(set = 0, binding = 4, std430) coherent restrict buffer TileHeads { uint head[]; } tile_heads; // cleared to NO_NODE
layout(set = 0, binding = 5, std430) writeonly restrict buffer TileNodes { TileNode node[]; } tile_nodes;
layout(location = 0) flat in uint particle_index;

void main() {
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    uint tile = pixel.y * params.tiling.tile_dim + pixel.x;
    Particle p = particles.particle[particle_index];
    uint key = light_key(light_depth(p.centre, params.tiling));
    uint level = pixel.y / params.tiling.tile_dim;
    uint bounds = pack_bounds(footprint(p, level, params.tiling), ivec2(pixel.x, pixel.y % params.tiling.tile_dim));
    uint slot = atomicAdd(counters.count.tile_nodes, 1u); // counts past capacity
    bool fits = slot < params.tiling.node_capacity;
    uint next = NO_NODE;
    beginInvocationInterlockARB();
    if (fits) {
        next = tile_heads.head[tile];
        tile_heads.head[tile] = slot;
    }
    endInvocationInterlockARB();
    if (fits) tile_nodes.node[slot] = TileNode(next, bounds, particle_index, key);
}
