// Turns the counts of this frame into indirect dispatch arguments. One thread.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid/params.glsl"
#include "grid/counters.glsl"
#include "compact/groups.glsl"
layout(local_size_x = 1) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer GridParamsBuffer { GridParams grid; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer ScanTotal { uint total; } scan_total; // particles wanted
layout(set = 0, binding = 2, std430) restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 3, std430) writeonly restrict buffer GridArgs { uvec4 emit; uvec4 particles; } grid_args;

void main() {
    uint generated = scan_total.total;
    uint stored = min(generated, params.grid.particle_capacity);
    counters.count.cells = params.grid.ring_count * params.grid.ring_dim * params.grid.ring_dim;
    counters.count.generated = generated;
    counters.count.stored = stored;
    grid_args.emit = groups_for(min(counters.count.valid_cells, params.grid.valid_cell_capacity), 64u);
    grid_args.particles = groups_for(stored, 64u);
}
