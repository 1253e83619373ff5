// Which tiles a particle covers, which tile a point looks in, and the order of a list.
#ifndef WELKIN_TILING_TILE
#define WELKIN_TILING_TILE
#include "compact/view.glsl"
#include "tiling/params.glsl"

struct TileRange {
    ivec2 least;
    ivec2 greatest; // inclusive; less than `least` in a component: none
};

// Footprint of the particle in a level: the bounding rectangle in tiles, conservative by 1 % and 0.5 m. (least u, least v,
// greatest u, greatest v)
vec4 footprint(Particle p, uint level, in TilingParams t) {
    vec3 relative = p.centre - t.centre;
    vec2 at = vec2(dot(relative, t.u_axis), dot(relative, t.v_axis));
    vec2 extent = vec2(ellipsoid_extent(p, t.u_axis), ellipsoid_extent(p, t.v_axis)) * 1.01 + 0.5;
    vec4 rect = t.level_rect[level];
    return vec4(at - extent - rect.xy, at + extent - rect.xy) * rect.zwzw;
}

// The tiles that a footprint touches.
TileRange footprint_tiles(vec4 footprint, in TilingParams t) {
    float dim = float(t.tile_dim);
    return TileRange(ivec2(clamp(floor(footprint.xy), vec2(0.0), vec2(dim))),
                     ivec2(clamp(floor(footprint.zw), vec2(-1.0), vec2(dim - 1.0))));
}

// A point or a corner in a tile, in 128ths of it.
uvec2 within_tile(vec2 at, ivec2 tile) {
    return uvec2(clamp(floor((at - vec2(tile)) * 128.0), vec2(0.0), vec2(127.0)));
}

// Part of a tile that a footprint covers, such that `in_bounds` holds for every point of it: the corners are rounded as
// points are.
uint pack_bounds(vec4 footprint, ivec2 tile) {
    uvec2 least = within_tile(footprint.xy, tile), greatest = 127u - within_tile(footprint.zw, tile);
    return least.x | least.y << 8u | greatest.x << 16u | greatest.y << 24u;
}

// A receiver at `at` [tiles] for `in_bounds`.
uint pack_receiver(vec2 at, ivec2 tile) {
    uvec2 point = within_tile(at, tile);
    return 0x80808080u | point.x | point.y << 8u | (127u - point.x) << 16u | (127u - point.y) << 24u;
}

// Four comparisons in one: no byte is less than what the bounds ask for, so none borrows its top bit.
bool in_bounds(uint receiver, uint bounds) { return ((receiver - bounds) & 0x80808080u) == 0x80808080u; }

// Whether any receiver of the level may lie in the particle's shadow inside the slab. Receivers of level i lie between
// two Chebyshev distances from the centre; the shadow runs `reach` metres away from the light.
bool shades_level(Particle p, uint level, in TilingParams t) {
    vec3 a = p.centre - t.centre;
    float horizontal = length(t.to_sun.xz);
    vec2 shadow = horizontal > 1e-6 ? t.to_sun.xz * (t.reach / horizontal) : vec2(0.0);
    vec2 b = a.xz - shadow;
    float radius = max(p.semi_axes.x, max(p.semi_axes.y, p.semi_axes.z)) + 1.0;
    // A receiver is lit at its far pole too: its centre may lie on the light's side of the occluder by as much as it
    // reaches. What is largest halves from level to level inwards.
    radius += t.greatest_extent * exp2(float(level) + 1.0 - float(t.level_count));
    // The Chebyshev norm is convex: greatest at an end of the segment. Its least is bounded by each axis alone.
    float greatest = max(max(abs(a.x), abs(a.z)), max(abs(b.x), abs(b.y))) + radius;
    float least_x = a.x * b.x <= 0.0 ? 0.0 : min(abs(a.x), abs(b.x));
    float least_z = a.z * b.y <= 0.0 ? 0.0 : min(abs(a.z), abs(b.y));
    float least = max(least_x, least_z) - radius;
    return greatest >= t.level_range[level].x && least <= t.level_range[level].y;
}

// Whether the particle is inserted in the level at all.
bool in_level(Particle p, uint level, in TilingParams t) {
    return p.density * p.fade > 0.0 && shades_level(p, level, t);
}

// Level that a receiver uses; level_count outside all.
uint receiver_level(vec3 p_ws, in TilingParams t) {
    vec2 d = abs(p_ws.xz - t.centre.xz);
    float distance = max(d.x, d.y);
    uint level = 0u;
    while (level < t.level_count && distance > t.level_range[level].y) ++level;
    return level;
}

uint tile_index(ivec2 tile, uint level, in TilingParams t) {
    return (level * t.tile_dim + uint(tile.y)) * t.tile_dim + uint(tile.x);
}

// Tile of a receiver, or NO_NODE. `receiver`: where it lies in the tile, for `in_bounds`.
uint receiver_tile(vec3 p_ws, in TilingParams t, out uint receiver) {
    receiver = 0u;
    uint level = receiver_level(p_ws, t);
    if (level >= t.level_count) return NO_NODE;
    vec3 relative = p_ws - t.centre;
    vec2 at = (vec2(dot(relative, t.u_axis), dot(relative, t.v_axis)) - t.level_rect[level].xy) * t.level_rect[level].zw;
    ivec2 tile = ivec2(floor(at));
    if (any(lessThan(tile, ivec2(0))) || any(greaterThanEqual(tile, ivec2(t.tile_dim)))) return NO_NODE;
    receiver = pack_receiver(at, tile);
    return tile_index(tile, level, t);
}

// Depth towards the light [m]. Exact arithmetic: the same order on every device.
float light_depth(vec3 centre, in TilingParams t) {
    precise float x = centre.x - t.centre.x;
    precise float y = centre.y - t.centre.y;
    precise float z = centre.z - t.centre.z;
    precise float along_x = x * t.to_sun.x;
    precise float along_y = y * t.to_sun.y;
    precise float along_z = z * t.to_sun.z;
    precise float result = (along_x + along_y) + along_z;
    return result;
}

// Key that sorts ascending what is nearest the light first.
uint light_key(float depth) {
    uint bits = floatBitsToUint(depth);
    uint ascending = (bits >> 31u) != 0u ? ~bits : bits | 0x80000000u;
    return ~ascending;
}

#endif
