// Classifies every cell of the nested rings: how many particles stand on it, and the list of those that hold any.
// One thread a cell. Yusov 5.2, step 1.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid/cell.glsl"
#include "grid/counters.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer GridParamsBuffer { GridParams grid; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer CoverageMap { float texel[]; } coverage_map; // row 0 at least z
layout(set = 0, binding = 2, std430) restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 3, std430) writeonly restrict buffer CellParticles { uint count[]; } cell_particles;
layout(set = 0, binding = 4, std430) writeonly restrict buffer CellShapes { vec4 shape[]; } cell_shapes; // height, body, weight, counts
layout(set = 0, binding = 5, std430) writeonly restrict buffer ValidCells { uint cell[]; } valid_cells;

float map_texel(int x, int z) {
    int width = int(params.grid.map_width), height = int(params.grid.map_height);
    x -= x / width * width;
    z -= z / height * height;
    if (x < 0) x += width;
    if (z < 0) z += height;
    return coverage_map.texel[z * width + x];
}

// Bilinear, repeated; the uniform coverage without an image.
float coverage_at(CellPlace place) {
    if (params.grid.map_width == 0u) return params.grid.coverage;
    int steps = params.grid.ring_first[place.ring].w;
    ivec2 position = place.absolute * steps + (steps >> 1);
    position -= ivec2(params.grid.map_centre_x, params.grid.map_centre_z);
    LatticePoint p = turned_lattice_point(position, params.grid.frequency_map_along, params.grid.frequency_map_across,
                                          ivec2(params.grid.map_width, params.grid.map_height) - 1);
    precise float u = p.fraction.x, v = p.fraction.y;
    precise float a = map_texel(p.cell.x, p.cell.y);
    precise float b = map_texel(p.cell.x + 1, p.cell.y);
    precise float c = map_texel(p.cell.x, p.cell.y + 1);
    precise float d = map_texel(p.cell.x + 1, p.cell.y + 1);
    precise float ab_step = u * (b - a);
    precise float cd_step = u * (d - c);
    precise float ab = a + ab_step;
    precise float cd = c + cd_step;
    precise float v_step = v * (cd - ab);
    precise float result = ab + v_step;
    return result;
}

void main() {
    uint cell_id = gl_GlobalInvocationID.x;
    if (cell_id >= params.grid.ring_count * params.grid.ring_dim * params.grid.ring_dim) return;
    CellPlace place = cell_place(cell_id, params.grid);
    CellShape shape = cell_shape(place, coverage_at(place), params.grid);
    cell_particles.count[cell_id] = shape.layers + shape.puffs;
    cell_shapes.shape[cell_id] = vec4(shape.height, shape.body, shape.weight, pack_counts(shape));
    if (shape.layers > 0u) {
        // Counts past capacity, so the host reads the true need. The order is arbitrary; the slot of a particle comes
        // from a prefix sum over cells, so nothing downstream depends on it.
        uint slot = atomicAdd(counters.count.valid_cells, 1u);
        if (slot < params.grid.valid_cell_capacity) valid_cells.cell[slot] = cell_id;
    }
}
