#version 460
#extension GL_GOOGLE_include_directive : require
// Puts each cell's list in the order of particle indices, so that it does not depend on scheduling, and sums extinctions.
// Heap sort (Williams 1964), where a list is not in order already: long lists are rare, but a thread's loops must not take
// more than 65 535 rounds, after which Mesa 22.3's lavapipe ends them.
#include "pathtrace/cells.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer CellParamsBuffer { CellParams cells; } params;
layout(binding = 1, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 2, std430) restrict readonly buffer EntryFirst { uint first[]; } entry_first;
layout(binding = 3, std430) restrict buffer Entries { CellEntry entry[]; } entries;
layout(binding = 4, std430) restrict writeonly buffer Cells { Cell cell[]; } cells;
layout(push_constant) uniform CellOrderPush { uint cell_count; uint entry_count; } push;

// Puts the particle at `root` of the heap of `count` at its place below.
void sift(uint first, uint root, uint count) {
    uint particle = entries.entry[first + root].particle;
    for (uint child = 2u * root + 1u; child < count; child = 2u * root + 1u) {
        if (child + 1u < count && entries.entry[first + child + 1u].particle > entries.entry[first + child].particle) ++child;
        uint greater = entries.entry[first + child].particle;
        if (greater <= particle) break;
        entries.entry[first + root].particle = greater;
        root = child;
    }
    entries.entry[first + root].particle = particle;
}

void sort(uint first, uint count) {
    for (uint root = count / 2u; root > 0u; --root) sift(first, root - 1u, count);
    for (uint left = count; left > 1u; --left) {
        uint greatest = entries.entry[first].particle;
        entries.entry[first].particle = entries.entry[first + left - 1u].particle;
        entries.entry[first + left - 1u].particle = greatest;
        sift(first, 0u, left - 1u);
    }
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.cell_count) return;
    uint first = entry_first.first[index];
    uint end = index + 1u < push.cell_count ? entry_first.first[index + 1u] : push.entry_count;
    bool ordered = true;
    for (uint i = first + 1u; i < end && ordered; ++i) {
        ordered = entries.entry[i - 1u].particle < entries.entry[i].particle;
    }
    if (!ordered) sort(first, end - first);
    float sum = 0.0;
    for (uint i = first; i < end; ++i) {
        sum += greatest_extinction(particles.elements[entries.entry[i].particle], params.cells);
        entries.entry[i].sum = sum;
    }
    cells.cell[index] = Cell(first, end - first, sum, 1.0);
}
