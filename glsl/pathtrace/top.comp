#version 460
#extension GL_GOOGLE_include_directive : require
// For each top cell, the least radius of the particles that meet it (as bits; all ones where none does).
#include "pathtrace/cells.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer CellParamsBuffer { CellParams cells; } params;
layout(binding = 1, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 2, std430) restrict coherent buffer LeastRadius { uint bits[]; } least_radius;

void main() {
    CellParams cells = params.cells;
    uint index = gl_GlobalInvocationID.x;
    if (index >= cells.particles) return;
    Particle p = particles.elements[index];
    if (!(greatest_extinction(p, cells) > 0.0)) return;
    ivec3 count = ivec3(cells.top_x, cells.top_y, cells.top_z);
    vec3 reach = ellipsoid_reach(p) + cells.slack, offset = p.centre - cells.least;
    ivec3 from = cell_at(offset - reach, cells.top_edge, count), to = cell_at(offset + reach, cells.top_edge, count);
    vec3 half_sides = vec3(0.5 * cells.top_edge + cells.slack);
    uint radius = floatBitsToUint(pow(p.semi_axes.x * p.semi_axes.y * p.semi_axes.z, 1.0 / 3.0));
    for (int z = from.z; z <= to.z; ++z)
    for (int y = from.y; y <= to.y; ++y)
    for (int x = from.x; x <= to.x; ++x) {
        vec3 centre = cells.least + (vec3(x, y, z) + 0.5) * cells.top_edge;
        if (ellipsoid_meets(p, centre, half_sides)) atomicMin(least_radius.bits[(z * count.y + y) * count.x + x], radius);
    }
}
