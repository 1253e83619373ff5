#version 460
#extension GL_GOOGLE_include_directive : require
// How likely it is that sunlight reaches a cell, as far as the majorants tell: rays to the sun are sent from its events
// with this probability and count for its reciprocal, so that any value above 0 is right and a good one saves the rays that
// begin deep inside a cloud. One group a top cell.
#include "pathtrace/cells.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer CellGridBuffer { CellParams params; } grid;
layout(binding = 1, std430) restrict readonly buffer CellCounts { uint count[]; } cell_counts;
layout(binding = 2, std430) restrict readonly buffer CellFirst { uint first[]; } cell_first;
layout(binding = 3, std430) restrict buffer CellList { Cell cell[]; } cells;
layout(push_constant) uniform SunnyPush { vec3 to_sun; float reserved; } push;
CellParams cell_grid;
#include "pathtrace/find.glsl"

// Density is less than the majorant, and light finds gaps: this much of the optical depth counts, and no cell is given
// up (both tuned by variance times work, docs/reference.md).
const float SHARE = 0.02;
const float LEAST = 0.05;

void main() {
    cell_grid = grid.params;
    CellParams g = cell_grid;
    uint top = gl_WorkGroupID.x;
    int n = split_of(cell_counts.count[top]);
    vec3 corner = g.least + vec3(top % g.top_x, top / g.top_x % g.top_y, top / (g.top_x * g.top_y)) * g.top_edge;
    for (uint i = gl_LocalInvocationIndex; i < uint(n * n * n); i += 64u) {
        float edge = g.top_edge / float(n);
        vec3 at = corner + (vec3(i % uint(n), i / uint(n) % uint(n), i / uint(n * n)) + 0.5) * edge;
        vec3 start = at - 0.5 * edge;
        float t = wall_ahead(at, push.to_sun, start, edge) + 0.25 * g.slack, tau = 0.0;
        while (tau * SHARE < 4.0) {
            vec3 x = at + t * push.to_sun;
            if (any(lessThan(x, g.least)) || any(greaterThan(x, g.greatest))) break;
            Cell cell = find_cell(x, start, edge);
            float next = max(wall_ahead(at, push.to_sun, start, edge), t) + 0.25 * g.slack;
            tau += cell.majorant * (next - t);
            t = next;
        }
        cells.cell[cell_first.first[top] + i].sunny = max(exp(-SHARE * tau), LEAST);
    }
}
