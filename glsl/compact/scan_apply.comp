// Exclusive prefix sum of 1024 numbers a work group, on top of the scanned block sums.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "compact/scan.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Values { uint value[]; } values;
layout(set = 0, binding = 1, std430) readonly restrict buffer BlockSums { uint sum[]; } block_sums; // scanned
layout(set = 0, binding = 2, std430) writeonly restrict buffer Scanned { uint value[]; } scanned;
layout(push_constant) uniform ScanApplyPush { uint count; } push;

void main() {
    uint first = gl_WorkGroupID.x * 1024u + gl_LocalInvocationIndex * 16u;
    uint sum = 0u;
    for (uint i = first; i < min(first + 16u, push.count); ++i) sum += values.value[i];
    uint total;
    uint before = block_sums.sum[gl_WorkGroupID.x] + group_exclusive_sum(sum, total);
    for (uint i = first; i < min(first + 16u, push.count); ++i) {
        scanned.value[i] = before;
        before += values.value[i];
    }
}
