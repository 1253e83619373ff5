#version 460
// Source at every point of every ray, in the frame of the ray. In: sources on shells. Out: field. See transport.glsl.
#extension GL_GOOGLE_include_directive : require
#include "lut/transport.glsl"

layout(local_size_x = TRANSPORT_BUCKET) in;
layout(binding = 0, std430) restrict readonly buffer Jobs { TransportJob at[]; } jobs;
layout(binding = 1, std430) restrict readonly buffer Buckets { TransportBucket at[]; } buckets;
layout(binding = 2, std430) restrict readonly buffer Order { uint at[]; } order;           // the points, bucket by bucket
layout(binding = 3, std430) restrict readonly buffer Points { TransportPoint at[]; } points;
layout(binding = 4, std430) restrict readonly buffer Basis { float at[]; } basis;          // [component][place in the order]
layout(binding = 5, std430) restrict readonly buffer Rotations { float at[]; } rotations;
layout(binding = 6, std430) restrict readonly buffer Sources { float at[]; } sources;
layout(binding = 7, std430) restrict writeonly buffer Field { vec2 at[]; } field;
layout(push_constant) uniform EmitPush { uint point_count; uint shell_count; uint l_max; };

const uint BLOCK = 8u;   // orders about the normal that are summed at once

void main() {
    // Jobs come first, so that the basis of a bucket stays in a cache until all have used it.
    TransportJob job = jobs.at[gl_WorkGroupID.x];
    TransportBucket bucket = buckets.at[gl_WorkGroupID.y];
    if (gl_LocalInvocationID.x >= bucket.count) return;
    uint place = bucket.start + gl_LocalInvocationID.x;
    uint p = order.at[place];
    TransportPoint point = points.at[p];

    // Orders about the radius: a_m = Σ_l s_lm(r) y_lm(μ).
    float a[TRANSPORT_ORDERS];
    uint m_max = min(job.j, l_max);
    uint component = 0u;
    for (uint m = 0u; m <= m_max; ++m) {
        float sum = 0.0;
        for (uint l = m; l <= l_max; ++l, ++component) {
            uint s = job.source + component * shell_count + bucket.shell;
            float value = sources.at[s];
            if (bucket.crossing == 0u) {
                value = point.weights.x * value + point.weights.y * sources.at[s + 1u]
                      + point.weights.z * sources.at[s + 2u] + point.weights.w * sources.at[s + 3u];
            }
            sum += value * basis.at[component * point_count + place];
        }
        a[m] = sum;
    }

    // Orders about the normal, then the frame of the ray: a factor e^(-i n α).
    vec2 turn = vec2(point.cos_alpha, -point.sin_alpha);
    vec2 phase = (job.j & 1u) == 0u ? vec2(1.0, 0.0) : turn;
    turn = complex_multiply(turn, turn);
    uint last = job.j / 2u, width = m_max + 1u;
    for (uint first = 0u; first <= last; first += BLOCK) {
        vec2 c[BLOCK];
        for (uint i = 0u; i < BLOCK; ++i) c[i] = vec2(0.0);
        // Even orders meet the cosines, odd ones the sines.
        for (uint m = 0u; m <= m_max; m += 2u) {
            float even = a[m];
            for (uint i = 0u; i < BLOCK; ++i) c[i].x += rotations.at[job.rotation + min(first + i, last) * width + m] * even;
        }
        for (uint m = 1u; m <= m_max; m += 2u) {
            float odd = a[m];
            for (uint i = 0u; i < BLOCK; ++i) c[i].y += rotations.at[job.rotation + min(first + i, last) * width + m] * odd;
        }
        for (uint i = 0u; i < BLOCK; ++i) {
            if (first + i > last) break;
            field.at[job.field + (first + i) * point_count + p] = complex_multiply(c[i], phase);
            phase = complex_multiply(phase, turn);
        }
    }
}
