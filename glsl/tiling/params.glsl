// Light-space tile grids: one per ring, each covering that ring's cloud slab in the plane perpendicular to the light.
// Written by the host (src/tiling/params.rs).
#ifndef WELKIN_TILING_PARAMS
#define WELKIN_TILING_PARAMS

const uint TILE_LEVELS = 8u;
const uint NO_NODE = 0xffffffffu;

struct TilingParams {
    vec3 to_sun;           // unit, towards the light
    float base;            // cloud base at the centre [m, floating origin]
    vec3 u_axis;           // horizontal, perpendicular to the light
    float thickness;       // of the slab that holds every receiver [m]
    vec3 v_axis;           // to_sun × u_axis
    float inverse_diameter; // 1 / (2 · planet radius) [1/m]; 0 is a flat world
    vec3 centre;           // camera; the levels are squares around it [m, floating origin]
    float reach;           // longest horizontal way of light through the slab [m]
    vec4 level_rect[TILE_LEVELS];  // least u, least v [m]; tiles per metre along u, v
    vec4 level_range[TILE_LEVELS]; // x: least, y: greatest Chebyshev distance of receivers from the centre [m]
    uint level_count;
    uint tile_dim;         // tiles along an edge
    uint node_capacity;
    uint traversal_limit;  // nodes one receiver visits at most
    float extinction;      // sigma_t · mean fill of a particle: extinction at relative density 1 [1/m]
    float greatest_extent; // no particle reaches farther from its centre [m]
    uint levels_per_particle; // levels that one particle's shadow reaches at most
    uint unused;
};

// One occluder in one tile's list.
struct TileNode {
    uint next;     // NO_NODE ends a list
    uint bounds;   // what it covers of the tile: pack_bounds in tiling/tile.glsl
    uint particle;
    uint key;      // sorts what is nearest the light first
};

// A particle as the light meets it. Where light passes the centre at (u, v) along u_axis and v_axis [m], its way through
// the ellipsoid is 2 half_chord √(1 - q), q = (outline.x u + outline.y v)² + (outline.z v)²; the way's middle lies
// dot(shear, (u, v)) metres farther from the light than the centre. See tiling/occluder.glsl.
struct Occluder {
    vec3 centre;      // [m, floating origin]
    float half_chord; // along the light, through the centre [m]
    vec3 outline;     // [1/m]
    float density;    // relative density · fade
    vec2 shear;       // [1]
};

#endif
