#version 460
#extension GL_GOOGLE_include_directive : require
// Puts each cell's list in the order of particle indices, so that it does not depend on scheduling, and sums extinctions.
// Insertion sort: lists are short, and one that is filled in order costs nothing.
#include "pathtrace/cells.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer CellParamsBuffer { CellParams cells; } params;
layout(binding = 1, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 2, std430) restrict readonly buffer EntryFirst { uint first[]; } entry_first;
layout(binding = 3, std430) restrict buffer Entries { CellEntry entry[]; } entries;
layout(binding = 4, std430) restrict writeonly buffer Cells { Cell cell[]; } cells;
layout(push_constant) uniform CellOrderPush { uint cell_count; uint entry_count; } push;

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.cell_count) return;
    uint first = entry_first.first[index];
    uint end = index + 1u < push.cell_count ? entry_first.first[index + 1u] : push.entry_count;
    for (uint i = first + 1u; i < end; ++i) {
        uint particle = entries.entry[i].particle, j = i;
        for (; j > first && entries.entry[j - 1u].particle > particle; --j) {
            entries.entry[j].particle = entries.entry[j - 1u].particle;
        }
        entries.entry[j].particle = particle;
    }
    float sum = 0.0;
    for (uint i = first; i < end; ++i) {
        sum += greatest_extinction(particles.elements[entries.entry[i].particle], params.cells);
        entries.entry[i].sum = sum;
    }
    cells.cell[index] = Cell(first, end - first, sum, 1.0);
}
