// Optical depth of cloud between a point and the sun, by walking the list of the point's light tile.
//
// The includer declares, under these names, readonly buffers: `params.tiling` (TilingParams), `occluders.by[]`,
// `tile_heads.head[]`, `tile_nodes.node[]`. See lighting/tables/sun.comp.
//
// Each occluder counts with its own extinction, density and fade. (Yusov's released code scales it by the receiver's
// density; src/reference/lighting.rs tests that we do not.)
#ifndef WELKIN_LIGHTING_SUN_OPTICAL_DEPTH
#define WELKIN_LIGHTING_SUN_OPTICAL_DEPTH
#include "tiling/occluder.glsl"
#include "tiling/tile.glsl"

// Moves a point below the clouds along the light up to the base of the slab: nothing lies between, and the lists hold
// what shades receivers inside the slab. Two steps, because the base follows the planet's curvature.
vec3 lift_to_slab(vec3 p_ws, in TilingParams t) {
    if (t.to_sun.y <= 1e-3) return p_ws;
    for (int i = 0; i < 2; ++i) {
        vec2 d = p_ws.xz - t.centre.xz;
        float below = t.base - dot(d, d) * t.inverse_diameter - p_ws.y;
        if (below > 0.0) p_ws += t.to_sun * (below / t.to_sun.y);
    }
    return p_ws;
}

// At three points on the ray through `p_ws` towards the sun: `reach` ahead of it, there, and `reach` behind.
// `self`: a particle that does not occlude (NO_NODE: none). `visited`: nodes looked at; beyond the limit, the rest of the
// list was left out. Most nodes miss the point: `bounds` tells without a look at the occluder.
vec3 sun_optical_depths(vec3 p_ws, float reach, uint self, out uint visited) {
    visited = 0u;
    vec3 start = lift_to_slab(p_ws, params.tiling);
    uint receiver;
    uint tile = receiver_tile(start, params.tiling, receiver);
    if (tile == NO_NODE) return vec3(0.0);
    vec3 sum = vec3(0.0);
    // Copies: a driver need not know that the loop reads the same each time.
    vec3 u_axis = params.tiling.u_axis, v_axis = params.tiling.v_axis, to_sun = params.tiling.to_sun;
    float farthest = reach + params.tiling.greatest_extent + 0.5; // sorted by depths that are rounded in another way
    uint limit = params.tiling.traversal_limit;
    uint node = tile_heads.head[tile];
    visited = tile >> 31u; // 0, which compilers do not see: a count that lanes share, lavapipe keeps in memory
    while (node != NO_NODE && visited <= limit) {
        // Up to three nodes that miss in one go: more lanes of a subgroup then have an occluder to look at together.
        uint at = node;
        bool hit = false;
        for (int i = 0; i < 3; ++i) {
            if (hit || node == NO_NODE || ++visited > limit) continue;
            at = node;
            hit = in_bounds(receiver, tile_nodes.node[at].bounds);
            node = tile_nodes.node[at].next;
        }
        if (!hit) continue;
        uint occluder = tile_nodes.node[at].particle;
        Occluder o = occluders.by[occluder];
        vec3 away = start - o.centre;
        vec3 offset = vec3(dot(away, u_axis), dot(away, v_axis), dot(away, to_sun));
        float density = occluder == self ? 0.0 : o.density;
        sum += density * chords_ahead(o, offset, reach);
        // Front to back: from here on everything lies behind the receiver.
        if (offset.z > farthest) node = NO_NODE;
    }
    return params.tiling.extinction * sum;
}

// For any point at all: on the ground, in the air, on a cloud.
float sun_optical_depth(vec3 p_ws) {
    uint visited;
    return sun_optical_depths(p_ws, 0.0, NO_NODE, visited).y;
}

#endif
