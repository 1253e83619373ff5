#version 460
#extension GL_GOOGLE_include_directive : require
// Fills the cells' lists from their beginnings, in arbitrary order. `entry_counts` counts down to zero.
#include "pathtrace/cells.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer CellParamsBuffer { CellParams cells; } params;
layout(binding = 1, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 2, std430) restrict readonly buffer CellCounts { uint count[]; } cell_counts;
layout(binding = 3, std430) restrict readonly buffer CellFirst { uint first[]; } cell_first;
layout(binding = 4, std430) restrict coherent buffer EntryCounts { uint count[]; } entry_counts;
layout(binding = 5, std430) restrict readonly buffer EntryFirst { uint first[]; } entry_first;
layout(binding = 6, std430) restrict writeonly buffer Entries { CellEntry entry[]; } entries;
layout(push_constant) uniform CellFillPush { uint cell_count; uint entry_count; } push;
void visit(uint cell, uint particle) {
    uint end = cell + 1u < push.cell_count ? entry_first.first[cell + 1u] : push.entry_count;
    entries.entry[end - atomicAdd(entry_counts.count[cell], 0xffffffffu)].particle = particle;
}
#include "pathtrace/cover.glsl"
