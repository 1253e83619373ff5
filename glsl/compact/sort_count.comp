// Radix sort, step 1 of 3: how often each value of a 4-bit digit occurs in each block of 1024 keys. Counts lie digit
// by digit, so their prefix sum (scan_top) is where each block puts its keys of each digit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "compact/index.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer SortCount { uint count[]; } sort_count;
layout(set = 0, binding = 1, std430) readonly restrict buffer Keys { uint key[]; } keys;
layout(set = 0, binding = 2, std430) writeonly restrict buffer Digits { uint count[]; } digits;
layout(push_constant) uniform SortCountPush { uint count_index; uint shift; } push;

shared uint occurrences[16];

void main() {
    uint count = sort_count.count[push.count_index];
    uint blocks = (count + 1023u) / 1024u;
    uint block = linear_group();
    if (block >= blocks) return;
    if (gl_LocalInvocationIndex < 16u) occurrences[gl_LocalInvocationIndex] = 0u;
    barrier();
    for (uint i = 0u; i < 16u; ++i) {
        uint at = block * 1024u + i * 64u + gl_LocalInvocationIndex;
        if (at < count) atomicAdd(occurrences[(keys.key[at] >> push.shift) & 15u], 1u);
    }
    barrier();
    if (gl_LocalInvocationIndex < 16u) digits.count[gl_LocalInvocationIndex * blocks + block] = occurrences[gl_LocalInvocationIndex];
}
