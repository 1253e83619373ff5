// Sorts each tile's list front to back along the light, ties by particle. One thread a tile. After it the lists no longer
// depend on the order in which threads inserted.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tiling/params.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) restrict buffer TileHeads { uint head[]; } tile_heads;
layout(set = 0, binding = 1, std430) restrict buffer TileNodes { TileNode node[]; } tile_nodes;
layout(push_constant) uniform OrderPush { uint tile_count; } push;

uint list_next(uint node) { return tile_nodes.node[node].next; }
void list_link(uint node, uint next) { tile_nodes.node[node].next = next; }
bool list_before(uint a, uint b) {
    uint key_a = tile_nodes.node[a].key, key_b = tile_nodes.node[b].key;
    return key_a != key_b ? key_a < key_b : tile_nodes.node[a].particle < tile_nodes.node[b].particle;
}
#include "compact/list_sort.glsl"

void main() {
    uint tile = gl_GlobalInvocationID.x;
    if (tile >= push.tile_count) return;
    tile_heads.head[tile] = list_sort(tile_heads.head[tile]);
}
