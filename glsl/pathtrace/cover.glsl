// Visits every cell that a particle may reach, the lanes of a group together: one thread alone would take long, and Mesa
// 22.3's lavapipe ends all loops of a thread after 65 535 rounds. Included after `params`, `particles`, `cell_counts`,
// `cell_first` and a function visit(cell, particle index).
void cover(uint index, uint lane, uint lanes) {
    CellParams cells = params.cells;
    if (index >= cells.particles) return;
    Particle p = particles.elements[index];
    if (!(greatest_extinction(p, cells) > 0.0)) return;
    ivec3 count = ivec3(cells.top_x, cells.top_y, cells.top_z);
    vec3 reach = ellipsoid_reach(p) + cells.slack, offset = p.centre - cells.least;
    ivec3 from = cell_at(offset - reach, cells.top_edge, count), to = cell_at(offset + reach, cells.top_edge, count);
    for (int z = from.z; z <= to.z; ++z)
    for (int y = from.y; y <= to.y; ++y)
    for (int x = from.x; x <= to.x; ++x) {
        uint top = uint((z * count.y + y) * count.x + x);
        int n = split_of(cell_counts.count[top]);
        if (n == 0) continue;
        float edge = cells.top_edge / float(n);
        vec3 half_sides = vec3(0.5 * edge + cells.slack), corner = vec3(x, y, z) * cells.top_edge;
        ivec3 least = cell_at(offset - reach - corner, edge, ivec3(n));
        uvec3 box = uvec3(cell_at(offset + reach - corner, edge, ivec3(n)) - least + 1);
        for (uint i = lane; i < box.x * box.y * box.z; i += lanes) {
            ivec3 at = least + ivec3(i % box.x, i / box.x % box.y, i / (box.x * box.y));
            vec3 centre = cells.least + corner + (vec3(at) + 0.5) * edge;
            if (ellipsoid_meets(p, centre, half_sides)) visit(cell_first.first[top] + uint((at.z * n + at.y) * n + at.x), index);
        }
    }
}

// A group a particle, in rows: there may be more particles than groups along one side of a dispatch.
void main() { cover(gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x, gl_LocalInvocationIndex, gl_WorkGroupSize.x); }
