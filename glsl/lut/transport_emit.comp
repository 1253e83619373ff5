#version 460
// Source at every point of every ray, in the frame of the ray. In: sources on shells. Out: field. See transport.glsl.
// One invocation works on four points at once, so that what it reads of sources and rotations serves all four.
#extension GL_GOOGLE_include_directive : require
#include "lut/transport.glsl"

layout(local_size_x = TRANSPORT_BUCKET / TRANSPORT_EACH) in;
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

vec4 basis_at(uint component, uvec4 place) {
    uvec4 at = component * point_count + place;
    return vec4(basis.at[at.x], basis.at[at.y], basis.at[at.z], basis.at[at.w]);
}

void main() {
    // Jobs come first, so that the basis of a bucket stays in a cache until all have used it.
    TransportJob job = jobs.at[gl_WorkGroupID.x];
    TransportBucket bucket = buckets.at[gl_WorkGroupID.y];
    uvec4 index = gl_LocalInvocationID.x * TRANSPORT_EACH + uvec4(0u, 1u, 2u, 3u);
    if (index.x >= bucket.count) return;
    uvec4 place = bucket.start + min(index, bucket.count - 1u);
    uvec4 p = uvec4(order.at[place.x], order.at[place.y], order.at[place.z], order.at[place.w]);

    // Orders about the radius: a_m = Σ_l s_lm(r) y_lm(μ).
    vec4 a[TRANSPORT_ORDERS];
    uint m_max = min(job.j, l_max);
    uint s = job.source + bucket.shell;
    uint component = 0u;
    if (bucket.crossing != 0u) {
        for (uint m = 0u; m <= m_max; ++m) {
            vec4 sum = vec4(0.0);
            for (uint l = m; l <= l_max; ++l, ++component, s += shell_count) {
                sum += sources.at[s] * basis_at(component, place);
            }
            a[m] = sum;
        }
    } else {
        mat4 weights = transpose(mat4(points.at[p.x].weights, points.at[p.y].weights, points.at[p.z].weights, points.at[p.w].weights));
        for (uint m = 0u; m <= m_max; ++m) {
            vec4 sum = vec4(0.0);
            for (uint l = m; l <= l_max; ++l, ++component, s += shell_count) {
                vec4 value = weights * vec4(sources.at[s], sources.at[s + 1u], sources.at[s + 2u], sources.at[s + 3u]);
                sum += value * basis_at(component, place);
            }
            a[m] = sum;
        }
    }

    // Orders about the normal, then the frame of the ray: a factor e^(-i n α).
    vec4 cos_alpha = vec4(points.at[p.x].cos_alpha, points.at[p.y].cos_alpha, points.at[p.z].cos_alpha, points.at[p.w].cos_alpha);
    vec4 sin_alpha = vec4(points.at[p.x].sin_alpha, points.at[p.y].sin_alpha, points.at[p.z].sin_alpha, points.at[p.w].sin_alpha);
    bool is_odd = (job.j & 1u) != 0u;
    vec4 phase_re = is_odd ? cos_alpha : vec4(1.0), phase_im = is_odd ? -sin_alpha : vec4(0.0);
    vec4 turn_re = cos_alpha * cos_alpha - sin_alpha * sin_alpha, turn_im = -2.0 * cos_alpha * sin_alpha;
    bvec4 mine = lessThan(index, uvec4(bucket.count));
    uint last = job.j / 2u, width = m_max + 1u;
    for (uint first = 0u; first <= last; first += BLOCK) {
        vec4 even[BLOCK], odd[BLOCK];
        for (uint i = 0u; i < BLOCK; ++i) even[i] = odd[i] = vec4(0.0);
        // Even orders meet the cosines, odd ones the sines.
        for (uint m = 0u; m <= m_max; m += 2u) {
            vec4 value = a[m];
            for (uint i = 0u; i < BLOCK; ++i) even[i] += rotations.at[job.rotation + min(first + i, last) * width + m] * value;
        }
        for (uint m = 1u; m <= m_max; m += 2u) {
            vec4 value = a[m];
            for (uint i = 0u; i < BLOCK; ++i) odd[i] += rotations.at[job.rotation + min(first + i, last) * width + m] * value;
        }
        for (uint i = 0u; i < BLOCK; ++i) {
            if (first + i > last) break;
            uint base = job.field + (first + i) * point_count;
            vec4 re = even[i] * phase_re - odd[i] * phase_im, im = even[i] * phase_im + odd[i] * phase_re;
            if (mine.x) field.at[base + p.x] = vec2(re.x, im.x);
            if (mine.y) field.at[base + p.y] = vec2(re.y, im.y);
            if (mine.z) field.at[base + p.z] = vec2(re.z, im.z);
            if (mine.w) field.at[base + p.w] = vec2(re.w, im.w);
            vec4 next = phase_re * turn_re - phase_im * turn_im;
            phase_im = phase_re * turn_im + phase_im * turn_re;
            phase_re = next;
        }
    }
}
