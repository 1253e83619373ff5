#version 460
#extension GL_GOOGLE_include_directive : require
// How finely each top cell is divided, and into how many cells.
#include "pathtrace/cells.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer CellParamsBuffer { CellParams cells; } params;
layout(binding = 1, std430) restrict readonly buffer LeastRadius { uint bits[]; } least_radius;
layout(binding = 2, std430) restrict writeonly buffer CellCounts { uint count[]; } cell_counts;

void main() {
    CellParams cells = params.cells;
    uint index = gl_GlobalInvocationID.x;
    if (index >= cells.top_x * cells.top_y * cells.top_z) return;
    uint bits = least_radius.bits[index], n = 0u;
    if (bits != 0xffffffffu) {
        n = uint(clamp(ceil(cells.top_edge / (cells.fineness * uintBitsToFloat(bits))), 1.0, float(GREATEST_SPLIT)));
    }
    cell_counts.count[index] = n * n * n;
}
