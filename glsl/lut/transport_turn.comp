#version 460
// Radiance where rays cross shells, from the frame of the ray to orders m about the radius. See transport.glsl.
#extension GL_GOOGLE_include_directive : require
#include "lut/transport.glsl"

layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer Jobs { TransportJob at[]; } jobs;
layout(binding = 1, std430) restrict readonly buffer Points { TransportPoint at[]; } points;
layout(binding = 2, std430) restrict readonly buffer Crossings { uint at[]; } crossings;   // the point of each
layout(binding = 3, std430) restrict readonly buffer Rotations { float at[]; } rotations;
layout(binding = 4, std430) restrict readonly buffer Field { vec2 at[]; } field;
layout(binding = 5, std430) restrict writeonly buffer Orders { float at[]; } orders;       // [m][crossing]
layout(push_constant) uniform TurnPush { uint point_count; uint crossing_count; uint l_max; };

const uint BLOCK = 16u;   // orders that are summed at once

void main() {
    uint x = gl_GlobalInvocationID.x;
    if (x >= crossing_count) return;
    TransportJob job = jobs.at[gl_GlobalInvocationID.z];
    uint p = crossings.at[x];
    uint m_max = min(job.j, l_max);

    vec2 square = complex_multiply(vec2(points.at[p].cos_alpha, points.at[p].sin_alpha),
                                   vec2(points.at[p].cos_alpha, points.at[p].sin_alpha));
    for (uint first = 0u; first <= m_max; first += BLOCK) {
        float b[BLOCK];
        for (uint i = 0u; i < BLOCK; ++i) b[i] = 0.0;
        vec2 phase = (job.j & 1u) == 0u ? vec2(1.0, 0.0) : vec2(points.at[p].cos_alpha, points.at[p].sin_alpha);
        for (uint k = 0u; k <= job.j / 2u; ++k) {
            uint row = job.rotation + k * (m_max + 1u);
            vec2 c = complex_multiply(field.at[job.field + k * point_count + p], phase);
            // `first` is even: even orders meet the cosines, odd ones the sines.
            for (uint i = 0u; i < BLOCK; ++i) b[i] += rotations.at[row + min(first + i, m_max)] * ((i & 1u) == 0u ? c.x : c.y);
            phase = complex_multiply(phase, square);
        }
        for (uint i = 0u; i < BLOCK; ++i) {
            if (first + i <= m_max) orders.at[job.order + (first + i) * crossing_count + x] = b[i];
        }
    }
}
