// Radix sort, step 3 of 3: moves each key and its index to its place. Stable: a thread takes 16 neighbouring keys, and
// keys of one digit keep the order of threads, then of keys.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "compact/index.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer SortCount { uint count[]; } sort_count;
layout(set = 0, binding = 1, std430) readonly restrict buffer KeysIn { uint key[]; } keys_in;
layout(set = 0, binding = 2, std430) readonly restrict buffer IndicesIn { uint index[]; } indices_in;
layout(set = 0, binding = 3, std430) readonly restrict buffer Digits { uint first[]; } digits;
layout(set = 0, binding = 4, std430) writeonly restrict buffer KeysOut { uint key[]; } keys_out;
layout(set = 0, binding = 5, std430) writeonly restrict buffer IndicesOut { uint index[]; } indices_out;
layout(push_constant) uniform SortScatterPush { uint count_index; uint shift; } push;

shared uint before[16 * 64]; // per digit and thread: keys of that digit in earlier threads
shared uint quarter[16 * 4];

void main() {
    uint count = sort_count.count[push.count_index];
    uint blocks = (count + 1023u) / 1024u;
    uint block = linear_group();
    if (block >= blocks) return;
    uint lane = gl_LocalInvocationIndex;
    uint first = block * 1024u + lane * 16u;
    uint last = min(first + 16u, count);

    for (uint digit = 0u; digit < 16u; ++digit) before[digit * 64u + lane] = 0u;
    for (uint i = first; i < last; ++i) before[((keys_in.key[i] >> push.shift) & 15u) * 64u + lane] += 1u;
    barrier();
    // Four threads a digit: sums of 16 threads' counts, then a running sum within.
    uint digit = lane / 4u, part = lane % 4u;
    uint sum = 0u;
    for (uint i = 0u; i < 16u; ++i) sum += before[digit * 64u + part * 16u + i];
    quarter[lane] = sum;
    barrier();
    uint running = digits.first[digit * blocks + block];
    for (uint i = 0u; i < part; ++i) running += quarter[digit * 4u + i];
    for (uint i = 0u; i < 16u; ++i) {
        uint at = digit * 64u + part * 16u + i;
        uint value = before[at];
        before[at] = running;
        running += value;
    }
    barrier();
    for (uint i = first; i < last; ++i) {
        uint key = keys_in.key[i];
        uint slot = before[((key >> push.shift) & 15u) * 64u + lane]++;
        keys_out.key[slot] = key;
        indices_out.index[slot] = indices_in.index[i];
    }
}
