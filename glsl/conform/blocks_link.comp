#version 460
// Builds linked lists as tiling/insert.frag and the blend mode `list` do: a node from a pool, then an exchange on the head.
#extension GL_GOOGLE_include_directive : require
#include "conform/blocks.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) restrict buffer LinkCount { uint wanted; } counter;
layout(binding = 1, std430) restrict buffer LinkHeads { uint first[]; } heads;      // node + 1; 0: none
layout(binding = 2, std430) restrict writeonly buffer LinkNodes { uvec2 node[]; } nodes;   // next + 1, id
layout(push_constant) uniform BlocksLinkPush { uint count; uint capacity; uint guard; uint lists; } push;

void main() {
    uint id = gl_GlobalInvocationID.x;
    if (id >= push.count) return;
    uint head = conform_hash(id) % push.lists;
    uint node = atomicAdd(counter.wanted, 1u);
    if (SABOTAGE == BROKEN_REVERSED) node = min(node, push.capacity + push.guard - 1u);   // written where there is no room
    else if (node >= push.capacity) return;
    uint next;
    if (SABOTAGE == BROKEN_UNORDERED) {
        next = heads.first[head];
        heads.first[head] = node + 1u;
    } else {
        next = atomicExchange(heads.first[head], node + 1u);
    }
    nodes.node[node] = uvec2(SABOTAGE == BROKEN_LOST && node == push.capacity / 2u ? 0u : next, id);
}
