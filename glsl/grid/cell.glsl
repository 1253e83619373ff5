// From a cell of the nested rings to the column of cloud that stands on it.
#ifndef WELKIN_GRID_CELL
#define WELKIN_GRID_CELL
#include "grid/params.glsl"

struct CellPlace {
    uint ring;
    ivec2 local;    // within the ring
    ivec2 absolute; // lattice index in the world, of this ring's cell size
    vec2 centre;    // x, z [m, floating origin]
};

struct CellShape {
    uint layers;     // 0: no cloud
    uint puffs;      // small billows on top of them
    float height;    // of the column [m]
    float body;      // 0 at a cloud's outline, 1 well inside
    float weight;    // level-of-detail cross-fade, 0..1
};

CellPlace cell_place(uint cell_id, in GridParams p) {
    uint per_ring = p.ring_dim * p.ring_dim;
    uint ring = cell_id / per_ring;
    uint within = cell_id - ring * per_ring;
    ivec2 local = ivec2(int(within % p.ring_dim), int(within / p.ring_dim));
    precise float edge = p.ring_frame[ring].z;
    precise float x_cells = float(local.x) + 0.5;
    precise float z_cells = float(local.y) + 0.5;
    precise float x_offset = x_cells * edge;
    precise float z_offset = z_cells * edge;
    precise float x = p.ring_frame[ring].x + x_offset;
    precise float z = p.ring_frame[ring].y + z_offset;
    return CellPlace(ring, local, p.ring_first[ring].xy + local, vec2(x, z));
}

// 3t² - 2t³ of t clamped to [0, 1].
float smooth_unit(float t) {
    precise float c = clamp(t, 0.0, 1.0);
    precise float cc = c * c;
    precise float twice = c * 2.0;
    precise float result = cc * (3.0 - twice);
    return result;
}

// 1 well inside ring `ring`, 0 from one cell before the least it can reach, whatever the camera's place in its cell.
// The blend is four cells wide (the overlap of the rings); the last ring ends in a circle.
float ring_reach(vec2 centre, uint ring, in GridParams p) {
    precise float x = centre.x - p.camera.x;
    precise float z = centre.y - p.camera.z;
    if (ring + 1u == p.ring_count) {
        precise float xx = x * x;
        precise float zz = z * z;
        precise float d2 = xx + zz;
        precise float relative = d2 * p.inverse_cutoff_squared;
        precise float t = (relative - 0.8) * 6.25;
        precise float result = 1.0 - smooth_unit(t);
        return result;
    }
    precise float distance = max(abs(x), abs(z));
    precise float cells = distance * p.ring_frame[ring].w;
    precise float start = float(p.ring_dim / 2u) - 5.0;
    precise float t = (cells - start) * 0.25;
    precise float result = 1.0 - smooth_unit(t);
    return result;
}

// The weights of all rings add up to 1 at every point within the cut-off.
float ring_weight(vec2 centre, uint ring, in GridParams p) {
    precise float result = ring_reach(centre, ring, p);
    if (ring > 0u) {
        precise float hole = 1.0 - ring_reach(centre, ring - 1u, p);
        result = result * hole;
    }
    return result;
}

// Field value above which a share `coverage` of the world lies, linear between 65 knots.
float coverage_threshold(float coverage, in GridParams p) {
    precise float knots = clamp(coverage, 0.0, 1.0) * 64.0;
    int knot = min(int(knots), 63);
    precise float t = knots - float(knot);
    precise float a = p.threshold[knot >> 2][knot & 3];
    precise float b = p.threshold[(knot + 1) >> 2][(knot + 1) & 3];
    precise float rise = t * (b - a);
    precise float result = a + rise;
    return result;
}

// Layer that carries a puff with hash `id`. Of columns that grow, one that does not depend on their height (`p.evolving`),
// or the top one while it is not there yet: puff_fade() hides the puff until then.
uint puff_host(uint id, CellShape shape, uint ring, in GridParams p) {
    if (p.evolving != 0u) return min(id % uint(p.ring_first[ring].z), shape.layers - 1u);
    return shape.body < 1.0 ? id % shape.layers : shape.layers - 1u;
}

// Two counts in one float of the cell's record, exact.
float pack_counts(CellShape shape) { return float(shape.layers + 64u * shape.puffs); }

CellShape unpack_shape(vec4 stored) {
    uint counts = uint(stored.w);
    return CellShape(counts % 64u, counts / 64u, stored.x, stored.y, stored.z);
}

// The column on a cell. `coverage` is the wanted share of covered area around the cell.
CellShape cell_shape(CellPlace place, float coverage, in GridParams p) {
    CellShape shape = CellShape(0u, 0u, 0.0, 0.0, 0.0);
    shape.weight = ring_weight(place.centre, place.ring, p);
    if ((!(shape.weight > 0.0) && place.ring != 1u) || !(coverage > 0.0)) return shape;
    int steps = p.ring_first[place.ring].w;
    ivec2 position = place.absolute * steps + (steps >> 1);
    FieldFrequencies f = field_frequencies(p);
    precise float field = coverage_field(position, f, p.seed, p.ring_layer[place.ring].z);
    precise float excess = field - coverage_threshold(coverage, p);
    if (!(excess > 0.0)) return shape;
    // The column rises steeply from the outline, then follows the turrets: 2t - t² has a vertical-looking shoulder.
    precise float inside = min(excess * 1.0, 1.0);
    precise float inside_left = 1.0 - inside;
    precise float inside_squared = inside_left * inside_left;
    precise float shoulder = 1.0 - inside_squared;
    precise float turret = turret_field(position, f, p.seed);
    precise float from_mean = turret - 0.4;
    precise float resolved = from_mean * p.ring_layer[place.ring].z;
    precise float turret_term = (resolved + 0.4) * 0.62;
    precise float tower = turret_term + 0.38;
    precise float relative = shoulder * tower;
    precise float raised = relative * 0.92;
    precise float fraction = raised + 0.08;
    precise float height = fraction * p.thickness;
    precise float steps_up = height * p.ring_layer[place.ring].y;
    shape.layers = uint(clamp(int(ceil(steps_up)), 1, p.ring_first[place.ring].z));
    shape.body = min(excess * 5.0, 1.0);
    // Billows where a cell is near enough to show them: two at the outline, one on every other column inside.
    if (p.ring_frame[place.ring].z < 400.0) {
        shape.puffs = shape.body < 1.0 ? 2u : hash_lattice(place.absolute, p.seed + 15u) & 1u;
    }
    shape.height = height;
    if (place.ring == 1u) {
        // Coarse particles go on inside the finer ring, as cores of the bodies that its particles cover.
        precise float depth = (excess - 0.22) * 4.0;
        precise float reach_here = ring_reach(place.centre, place.ring, p);
        precise float core = reach_here * smooth_unit(depth);
        // Lower, softer and smaller than the cell's own column, into which it turns as the camera recedes: a core must
        // not show through its cover.
        precise float over = clamp((core - shape.weight) * 4.0, 0.0, 1.0);
        precise float drop = over * 0.12;
        precise float lower = height * (1.0 - drop);
        precise float softening = over * 0.4;
        precise float softer = shape.body * (1.0 - softening);
        shape.height = lower;
        shape.body = softer;
        shape.weight = max(shape.weight, core);
        if (!(shape.weight > 0.0)) { shape.layers = 0u; shape.puffs = 0u; }
    }
    if (p.evolving != 0u && shape.layers > 0u) {
        // A column that comes into being fades in; its layers are those of the height that it has in the end.
        precise float appear = excess * 20.0;
        shape.weight = shape.weight * smooth_unit(appear);
        precise float steps_now = shape.height * p.ring_layer[place.ring].y;
        shape.layers = uint(clamp(int(ceil(steps_now)), 1, p.ring_first[place.ring].z));
        if (!(shape.weight > 0.0)) { shape.layers = 0u; shape.puffs = 0u; }
    }
    return shape;
}

#endif
