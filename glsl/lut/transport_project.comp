#version 460
// Moments of the radiance on every shell, times albedo and phase function: the source of the next event.
// One invocation makes one component on one shell, from the crossings of that shell (a weighted least-squares fit in the
// direction cosine, whose weights the host made).
#extension GL_GOOGLE_include_directive : require
#include "lut/transport.glsl"

layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer Jobs { TransportJob at[]; } jobs;
layout(binding = 1, std430) restrict readonly buffer Components { uvec2 at[]; } components;  // l, m
layout(binding = 2, std430) restrict readonly buffer Ranges { uvec2 at[]; } ranges;          // first crossing of a shell, number
layout(binding = 3, std430) restrict readonly buffer Moments { float at[]; } moments;        // albedo times moment l
layout(binding = 4, std430) restrict readonly buffer Projection { float at[]; } projection;  // [component][crossing]
layout(binding = 5, std430) restrict readonly buffer Orders { float at[]; } orders;
layout(binding = 6, std430) restrict writeonly buffer Sources { float at[]; } sources;
layout(push_constant) uniform ProjectPush { uint shell_count; uint crossing_count; };

void main() {
    // Jobs come first, as in transport_emit.
    TransportJob job = jobs.at[gl_WorkGroupID.x];
    uint index = gl_WorkGroupID.y * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    uint component = index / shell_count, shell = index % shell_count;
    if (component >= job.components) return;
    uvec2 lm = components.at[component], range = ranges.at[shell];
    uint weight = component * crossing_count + range.x;
    uint order = job.order + lm.y * crossing_count + range.x;
    float sum = 0.0;
    for (uint x = 0u; x < range.y; ++x) sum += projection.at[weight + x] * orders.at[order + x];
    sources.at[job.source + component * shell_count + shell] = moments.at[lm.x] * sum;
}
