// Exclusive prefix sum within a work group of 64 (Hillis and Steele 1986). The includer has `shared uint partial[64]`.
#ifndef WELKIN_COMPACT_SCAN
#define WELKIN_COMPACT_SCAN

shared uint partial[64];

// Sum of `value` over the threads before this one; `total` over all. Call from uniform control flow.
uint group_exclusive_sum(uint value, out uint total) {
    uint lane = gl_LocalInvocationIndex;
    barrier();
    partial[lane] = value;
    for (uint stride = 1u; stride < 64u; stride <<= 1u) {
        barrier();
        uint below = lane >= stride ? partial[lane - stride] : 0u;
        barrier();
        partial[lane] += below;
    }
    barrier();
    total = partial[63];
    return partial[lane] - value;
}

#endif
