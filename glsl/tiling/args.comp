// Arguments of the sort along the light and of the draw that inserts: four vertices, and for each particle as many
// instances as it may have levels. One thread.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "compact/groups.glsl"
#include "grid/counters.glsl"
#include "tiling/params.glsl"
layout(local_size_x = 1) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer TilingParamsBuffer { TilingParams tiling; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 2, std430) writeonly restrict buffer TilingArgs { uvec4 sort; uvec4 draw; } tiling_args;

void main() {
    tiling_args.sort = groups_for(counters.count.stored, 1024u);
    tiling_args.draw = uvec4(4u, counters.count.stored * params.tiling.levels_per_particle, 0u, 0u);
}
