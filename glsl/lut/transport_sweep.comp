#version 460
// Radiance along every ray from the source along it, in place; one invocation follows one ray for one order.
// L(τ + d) = L(τ) e^(-d) + ∫ S e^(-(d - t)) dt, S a parabola through three points: the weights were made by the host.
#extension GL_GOOGLE_include_directive : require
#include "lut/transport.glsl"

layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer Jobs { TransportJob at[]; } jobs;
layout(binding = 1, std430) restrict readonly buffer Rays { uvec2 at[]; } rays;            // first point, number of points
layout(binding = 2, std430) restrict readonly buffer Steps { vec4 at[]; } steps;           // attenuation, start, end, third
layout(binding = 3, std430) restrict buffer Field { vec2 at[]; } field;
layout(push_constant) uniform SweepPush { uint point_count; uint ray_count; };

void main() {
    TransportJob job = jobs.at[gl_GlobalInvocationID.z];
    uint ray = gl_GlobalInvocationID.x % ray_count, k = gl_GlobalInvocationID.x / ray_count;
    if (k > job.j / 2u) return;
    uint count = rays.at[ray].y;
    uint base = job.field + k * point_count + rays.at[ray].x;
    uint step_base = rays.at[ray].x;

    vec2 before = vec2(0.0), start = field.at[base], radiance = vec2(0.0);
    vec2 end = count > 1u ? field.at[base + 1u] : vec2(0.0);
    field.at[base] = vec2(0.0);
    for (uint q = 1u; q < count; ++q) {
        vec4 w = steps.at[step_base + q];
        // The third point lies beyond the end, except for the last step.
        bool last = q + 1u == count;
        vec2 after = last ? vec2(0.0) : field.at[base + q + 1u];
        radiance = w.x * radiance + w.y * start + w.z * end + w.w * (last ? before : after);
        field.at[base + q] = radiance;
        before = start;
        start = end;
        end = after;
    }
}
