// Sums of blocks of 1024 numbers: first of three steps of an exclusive prefix sum that needs neither a subgroup size
// nor forward progress between work groups. Integer sums, so the result does not depend on any order.
#version 460
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Values { uint value[]; } values;
layout(set = 0, binding = 1, std430) writeonly restrict buffer BlockSums { uint sum[]; } block_sums;
layout(push_constant) uniform ScanReducePush { uint count; } push;

shared uint partial[64];

void main() {
    uint first = gl_WorkGroupID.x * 1024u + gl_LocalInvocationIndex * 16u;
    uint sum = 0u;
    for (uint i = first; i < min(first + 16u, push.count); ++i) sum += values.value[i];
    partial[gl_LocalInvocationIndex] = sum;
    for (uint stride = 32u; stride > 0u; stride >>= 1u) {
        barrier();
        if (gl_LocalInvocationIndex < stride) partial[gl_LocalInvocationIndex] += partial[gl_LocalInvocationIndex + stride];
    }
    if (gl_LocalInvocationIndex == 0u) block_sums.sum[gl_WorkGroupID.x] = partial[0];
}
