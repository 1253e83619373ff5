#version 460
// Radiance where rays cross shells, from the frame of the ray to orders m about the radius. See transport.glsl.
// One invocation works on four crossings, so that what it reads of rotations serves all four.
#extension GL_GOOGLE_include_directive : require
#include "lut/transport.glsl"

layout(local_size_x = TRANSPORT_BUCKET / TRANSPORT_EACH) in;
layout(binding = 0, std430) restrict readonly buffer Jobs { TransportJob at[]; } jobs;
layout(binding = 1, std430) restrict readonly buffer Points { TransportPoint at[]; } points;
layout(binding = 2, std430) restrict readonly buffer Crossings { uint at[]; } crossings;   // the point of each
layout(binding = 3, std430) restrict readonly buffer Rotations { float at[]; } rotations;
layout(binding = 4, std430) restrict readonly buffer Field { vec2 at[]; } field;
layout(binding = 5, std430) restrict writeonly buffer Orders { float at[]; } orders;       // [m][crossing]
layout(push_constant) uniform TurnPush { uint point_count; uint crossing_count; uint l_max; };

const uint BLOCK = 8u;   // orders that are summed at once; even

void main() {
    uvec4 index = gl_GlobalInvocationID.x * TRANSPORT_EACH + uvec4(0u, 1u, 2u, 3u);
    if (index.x >= crossing_count) return;
    bvec4 mine = lessThan(index, uvec4(crossing_count));
    uvec4 x = min(index, crossing_count - 1u);
    TransportJob job = jobs.at[gl_GlobalInvocationID.z];
    uvec4 p = uvec4(crossings.at[x.x], crossings.at[x.y], crossings.at[x.z], crossings.at[x.w]);
    uint m_max = min(job.j, l_max);

    vec4 cos_alpha = vec4(points.at[p.x].cos_alpha, points.at[p.y].cos_alpha, points.at[p.z].cos_alpha, points.at[p.w].cos_alpha);
    vec4 sin_alpha = vec4(points.at[p.x].sin_alpha, points.at[p.y].sin_alpha, points.at[p.z].sin_alpha, points.at[p.w].sin_alpha);
    vec4 turn_re = cos_alpha * cos_alpha - sin_alpha * sin_alpha, turn_im = 2.0 * cos_alpha * sin_alpha;
    bool is_odd = (job.j & 1u) != 0u;
    for (uint first = 0u; first <= m_max; first += BLOCK) {
        vec4 b[BLOCK];
        for (uint i = 0u; i < BLOCK; ++i) b[i] = vec4(0.0);
        vec4 phase_re = is_odd ? cos_alpha : vec4(1.0), phase_im = is_odd ? sin_alpha : vec4(0.0);
        uint row = job.rotation, base = job.field;
        for (uint k = 0u; k <= job.j / 2u; ++k, row += m_max + 1u, base += point_count) {
            vec2 f0 = field.at[base + p.x], f1 = field.at[base + p.y], f2 = field.at[base + p.z], f3 = field.at[base + p.w];
            vec4 f_re = vec4(f0.x, f1.x, f2.x, f3.x), f_im = vec4(f0.y, f1.y, f2.y, f3.y);
            vec4 re = f_re * phase_re - f_im * phase_im, im = f_re * phase_im + f_im * phase_re;
            // `first` is even: even orders meet the cosines, odd ones the sines.
            for (uint i = 0u; i < BLOCK; i += 2u) {
                b[i] += rotations.at[row + min(first + i, m_max)] * re;
                b[i + 1u] += rotations.at[row + min(first + i + 1u, m_max)] * im;
            }
            vec4 next = phase_re * turn_re - phase_im * turn_im;
            phase_im = phase_re * turn_im + phase_im * turn_re;
            phase_re = next;
        }
        for (uint i = 0u; i < BLOCK; ++i) {
            if (first + i > m_max) break;
            uint base = job.order + (first + i) * crossing_count;
            if (mine.x) orders.at[base + x.x] = b[i].x;
            if (mine.y) orders.at[base + x.y] = b[i].y;
            if (mine.z) orders.at[base + x.z] = b[i].z;
            if (mine.w) orders.at[base + x.w] = b[i].w;
        }
    }
}
