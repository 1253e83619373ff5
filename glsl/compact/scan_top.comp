// Exclusive prefix sum of one list in place, by one work group: the block sums of `scan_reduce`, or the digit counts
// of a sort. Writes the total behind it. Cost: linear, 1024 numbers a round.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "compact/scan.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) restrict buffer Values { uint value[]; } values;
layout(set = 0, binding = 1, std430) writeonly restrict buffer ScanTotal { uint total; } scan_total;
layout(set = 0, binding = 2, std430) readonly restrict buffer ScanCount { uint count[]; } scan_count;
// count_index: where `scan_count` holds the length in units of `per` items (rounded up) times `times`; or, with the
// top bit set, the low 31 bits are the length.
layout(push_constant) uniform ScanTopPush { uint count_index; uint per; uint times; } push;

void main() {
    uint count = push.count_index & 0x7fffffffu;
    if ((push.count_index >> 31u) == 0u) count = (scan_count.count[push.count_index] + push.per - 1u) / push.per * push.times;
    uint carried = 0u;
    for (uint round = 0u; round < count; round += 1024u) {
        uint first = round + gl_LocalInvocationIndex * 16u;
        uint sum = 0u;
        for (uint i = first; i < min(first + 16u, count); ++i) sum += values.value[i];
        uint total;
        uint before = carried + group_exclusive_sum(sum, total);
        for (uint i = first; i < min(first + 16u, count); ++i) {
            uint value = values.value[i];
            values.value[i] = before;
            before += value;
        }
        carried += total;
    }
    if (gl_LocalInvocationIndex == 0u) scan_total.total = carried;
}
