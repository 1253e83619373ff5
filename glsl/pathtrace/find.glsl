// The cell at a point. Included after `cell_grid`, `cell_counts`, `cell_first` and `cells`.
Cell find_cell(vec3 x, out vec3 corner, out float edge) {
    CellParams g = cell_grid;
    ivec3 tops = ivec3(g.top_x, g.top_y, g.top_z);
    ivec3 top = cell_at(x - g.least, g.top_edge, tops);
    uint index = uint((top.z * tops.y + top.y) * tops.x + top.x);
    corner = g.least + vec3(top) * g.top_edge;
    edge = g.top_edge;
    int n = split_of(cell_counts.count[index]);
    if (n == 0) return Cell(0u, 0u, 0.0, 0.0);
    edge = g.top_edge / float(n);
    ivec3 sub = cell_at(x - corner, edge, ivec3(n));
    corner += vec3(sub) * edge;
    return cells.cell[cell_first.first[index] + uint((sub.z * n + sub.y) * n + sub.x)];
}
