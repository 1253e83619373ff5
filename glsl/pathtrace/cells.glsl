// The two-level grid over all particles that paths are traced through. Top cells are nearly cubic and of one size; each is
// divided evenly into n³ cells, n by the size of the particles that meet it. A cell lists the particles that may reach it,
// in the order of their indices, with the running sum of their extinctions: the last sum is the cell's majorant, and a
// binary choice among the sums draws a particle in proportion to its own. Twin: src/pathtrace/cells.rs.
#ifndef PATHTRACE_CELLS
#define PATHTRACE_CELLS
#include "common/particle.glsl"

struct CellParams {
    vec3  least;         // corner of the grid, relative to the floating origin [m]
    float top_edge;      // of a top cell [m]
    vec3  greatest;      // the opposite corner [m]
    float slack;         // cells list what comes this near to them, so that rays may overshoot a wall a little [m]
    uint  top_x;         // top cells along each axis
    uint  top_y;
    uint  top_z;
    uint  particles;     // in the list
    float sigma_t;       // extinction at relative density 1 [1/m]
    float fineness;      // edge of a cell in radii of the smallest particle that meets its top cell
    uint  reserved_a;
    uint  reserved_b;
};

struct Cell {
    uint  first;         // entry of the list
    uint  count;
    float majorant;      // sum of the extinctions listed [1/m]
    float sunny;         // with which probability an event here is worth rays to the sun
};

struct CellEntry {
    uint  particle;
    float sum;           // of extinctions up to and with this one [1/m]
};

const uint GREATEST_SPLIT = 32u;

// n of a top cell with n³ cells.
int split_of(uint cells) { return int(round(pow(float(cells), 1.0 / 3.0))); }

float greatest_extinction(Particle p, CellParams cells) { return cells.sigma_t * p.density * p.fade; }

// Reciprocal of a direction with no infinities: a ray along a wall never meets it.
vec3 inverse_of(vec3 dir) { return 1.0 / mix(dir, vec3(1e-12), lessThan(abs(dir), vec3(1e-12))); }

// Distance from `origin` to where the ray leaves a cubic cell.
float wall_ahead(vec3 origin, vec3 dir, vec3 corner, float edge) {
    vec3 inverse = inverse_of(dir); // its signs: a direction along a wall has one too
    vec3 wall = (corner + mix(vec3(0.0), vec3(edge), greaterThan(inverse, vec3(0.0))) - origin) * inverse;
    return min(wall.x, min(wall.y, wall.z));
}

// Half the sides of the box around an ellipsoid.
vec3 ellipsoid_reach(Particle p) {
    vec3 a = rotate(p.rotation, vec3(p.semi_axes.x, 0.0, 0.0));
    vec3 b = rotate(p.rotation, vec3(0.0, p.semi_axes.y, 0.0));
    vec3 c = rotate(p.rotation, vec3(0.0, 0.0, p.semi_axes.z));
    return sqrt(a * a + b * b + c * c);
}

// Whether the ellipsoid may reach into a box of the given centre and half sides: in its unit ball the box lies within an
// axis-aligned one, whose distance from the centre is known. Never says no when it does.
bool ellipsoid_meets(Particle p, vec3 centre, vec3 half_sides) {
    vec3 c = abs(to_unit_ball(p, vec4(centre, 1.0)));
    vec3 x = abs(rotate_inverse(p.rotation, vec3(half_sides.x, 0.0, 0.0)));
    vec3 y = abs(rotate_inverse(p.rotation, vec3(0.0, half_sides.y, 0.0)));
    vec3 z = abs(rotate_inverse(p.rotation, vec3(0.0, 0.0, half_sides.z)));
    vec3 outside = max(c - (x + y + z) / p.semi_axes, 0.0);
    return dot(outside, outside) < 1.001; // rounding
}

// The cell of size `edge` along each axis in which an offset from the first corner lies.
ivec3 cell_at(vec3 offset, float edge, ivec3 count) { return clamp(ivec3(floor(offset / edge)), ivec3(0), count - 1); }

#endif
