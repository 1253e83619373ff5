// Writes the particles of every valid cell. One thread a cell. Yusov 5.2, step 2.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid/shape.glsl"
#include "grid/counters.glsl"
#include "compact/index.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer GridParamsBuffer { GridParams grid; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 2, std430) readonly restrict buffer ValidCells { uint cell[]; } valid_cells;
layout(set = 0, binding = 3, std430) readonly restrict buffer CellShapes { vec4 shape[]; } cell_shapes;
layout(set = 0, binding = 4, std430) readonly restrict buffer CellFirst { uint first[]; } cell_first;
layout(set = 0, binding = 5, std430) writeonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 6, std430) writeonly restrict buffer ParticleCells { uint cell_and_layer[]; } particle_cells;

void main() {
    uint index = linear_index();
    if (index >= min(counters.count.valid_cells, params.grid.valid_cell_capacity)) return;
    uint cell_id = valid_cells.cell[index];
    CellShape shape = unpack_shape(cell_shapes.shape[cell_id]);
    CellPlace place = cell_place(cell_id, params.grid);
    uint first = cell_first.first[cell_id];
    for (uint index = 0u; index < shape.layers + shape.puffs; ++index) {
        uint slot = first + index;
        if (slot >= params.grid.particle_capacity) return; // counted by args.comp; the list grows before the next frame
        particles.particle[slot] = column_particle(place, shape, index, params.grid);
        particle_cells.cell_and_layer[slot] = cell_id << 5u | index;
    }
}
