// Counts the nodes of another light's tiles with those of the sun's: what the longest of them wanted. One thread.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid/counters.glsl"
layout(local_size_x = 1) in;

layout(set = 0, binding = 0, std430) restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 1, std430) readonly restrict buffer LightCounters { Counters count; } light_counters;

void main() {
    counters.count.tile_nodes = max(counters.count.tile_nodes, light_counters.count.tile_nodes);
}
