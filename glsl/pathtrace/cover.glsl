// Visits every cell that a particle may reach. Included after `params`, `particles`, `cell_counts`, `cell_first` and a
// function visit(cell, particle index).
void cover(uint index) {
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
        ivec3 a = cell_at(offset - reach - corner, edge, ivec3(n)), b = cell_at(offset + reach - corner, edge, ivec3(n));
        for (int k = a.z; k <= b.z; ++k)
        for (int j = a.y; j <= b.y; ++j)
        for (int i = a.x; i <= b.x; ++i) {
            vec3 centre = cells.least + corner + (vec3(i, j, k) + 0.5) * edge;
            if (ellipsoid_meets(p, centre, half_sides)) visit(cell_first.first[top] + uint((k * n + j) * n + i), index);
        }
    }
}
