#version 460
// Source at every point of every ray, in the frame of the ray. In: sources on shells. Out: field. See transport.glsl.
#extension GL_GOOGLE_include_directive : require
#include "lut/transport.glsl"

layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer Jobs { TransportJob at[]; } jobs;
layout(binding = 1, std430) restrict readonly buffer Points { TransportPoint at[]; } points;
layout(binding = 2, std430) restrict readonly buffer Basis { float at[]; } basis;          // [component][point]
layout(binding = 3, std430) restrict readonly buffer Rotations { float at[]; } rotations;
layout(binding = 4, std430) restrict readonly buffer Sources { float at[]; } sources;
layout(binding = 5, std430) restrict writeonly buffer Field { vec2 at[]; } field;
layout(push_constant) uniform EmitPush { uint point_count; uint shell_count; uint l_max; };

void main() {
    uint p = gl_GlobalInvocationID.x;
    if (p >= point_count) return;
    TransportJob job = jobs.at[gl_GlobalInvocationID.z];
    TransportPoint point = points.at[p];

    // Orders about the radius: a_m = Σ_l s_lm(r) y_lm(μ).
    float a[TRANSPORT_ORDERS];
    uint m_max = min(job.j, l_max);
    uint component = 0u;
    for (uint m = 0u; m <= m_max; ++m) {
        float sum = 0.0;
        for (uint l = m; l <= l_max; ++l, ++component) {
            uint s = job.source + component * shell_count + point.first;
            float value;
            if (point.crossing != 0u) {
                value = sources.at[s];
            } else {
                value = point.weights.x * sources.at[s] + point.weights.y * sources.at[s + 1u]
                      + point.weights.z * sources.at[s + 2u] + point.weights.w * sources.at[s + 3u];
            }
            sum += value * basis.at[component * point_count + p];
        }
        a[m] = sum;
    }

    // Orders about the normal, then the frame of the ray: a factor e^(-i n α).
    vec2 turn = vec2(point.cos_alpha, -point.sin_alpha);
    vec2 phase = (job.j & 1u) == 0u ? vec2(1.0, 0.0) : turn;
    turn = complex_multiply(turn, turn);
    for (uint k = 0u; k <= job.j / 2u; ++k) {
        uint row = job.rotation + k * (m_max + 1u);
        vec2 c = vec2(0.0);
        for (uint m = 0u; m <= m_max; m += 2u) c.x += rotations.at[row + m] * a[m];
        for (uint m = 1u; m <= m_max; m += 2u) c.y += rotations.at[row + m] * a[m];
        field.at[job.field + k * point_count + p] = complex_multiply(c, phase);
        phase = complex_multiply(phase, turn);
    }
}
