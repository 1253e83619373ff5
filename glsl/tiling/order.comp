// Sorts each tile's list front to back along the light, ties by particle: a bottom-up merge sort on the links (Knuth,
// TAOCP 3, 5.2.4 L). One thread a tile; O(n log n), no extra memory. After it the lists no longer depend on the order in
// which threads inserted.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tiling/params.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) restrict buffer TileHeads { uint head[]; } tile_heads;
layout(set = 0, binding = 1, std430) restrict buffer TileNodes { TileNode node[]; } tile_nodes;
layout(push_constant) uniform OrderPush { uint tile_count; } push;

bool before(uint a, uint b) {
    uint key_a = tile_nodes.node[a].key, key_b = tile_nodes.node[b].key;
    return key_a != key_b ? key_a < key_b : tile_nodes.node[a].particle < tile_nodes.node[b].particle;
}

void main() {
    uint tile = gl_GlobalInvocationID.x;
    if (tile >= push.tile_count) return;
    uint head = tile_heads.head[tile];
    uint length = 0u;
    for (uint node = head; node != NO_NODE; node = tile_nodes.node[node].next) ++length;
    for (uint run = 1u; run < length; run <<= 1u) {
        uint left = head, tail = NO_NODE;
        head = NO_NODE;
        while (left != NO_NODE) {
            uint right = left, left_count = 0u, right_count = run;
            while (left_count < run && right != NO_NODE) {
                ++left_count;
                right = tile_nodes.node[right].next;
            }
            while (left_count > 0u || (right_count > 0u && right != NO_NODE)) {
                uint taken;
                bool from_left = left_count > 0u && (right_count == 0u || right == NO_NODE || !before(right, left));
                if (from_left) {
                    taken = left;
                    left = tile_nodes.node[left].next;
                    --left_count;
                } else {
                    taken = right;
                    right = tile_nodes.node[right].next;
                    --right_count;
                }
                if (tail == NO_NODE) head = taken;
                else tile_nodes.node[tail].next = taken;
                tail = taken;
            }
            left = right;
        }
        tile_nodes.node[tail].next = NO_NODE;
    }
    tile_heads.head[tile] = head;
}
