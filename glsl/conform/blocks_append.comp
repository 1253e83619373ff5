#version 460
// Appends the ids that a hash picks to a list, as grid/classify.comp does with cells: the counter goes on past the capacity,
// the list does not.
#extension GL_GOOGLE_include_directive : require
#include "conform/blocks.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) restrict buffer AppendCount { uint wanted; } counter;
layout(binding = 1, std430) restrict writeonly buffer AppendList { uint ids[]; } list;
layout(push_constant) uniform BlocksAppendPush { uint count; uint capacity; uint guard; uint lost; } push;

void main() {
    uint id = gl_GlobalInvocationID.x;
    if (id >= push.count || (conform_hash(id) & 3u) != 0u) return;
    if (SABOTAGE == BROKEN_LOST && id == push.lost) return;
    uint slot;
    if (SABOTAGE == BROKEN_UNORDERED) {
        slot = counter.wanted;
        counter.wanted = slot + 1u;
    } else {
        slot = atomicAdd(counter.wanted, 1u);
    }
    if (slot < push.capacity) {
        list.ids[slot] = id;
    } else if (SABOTAGE == BROKEN_REVERSED) {
        list.ids[min(slot, push.capacity + push.guard - 1u)] = id;
    }
}
