// Optical depth of cloud between a point and the sun, by walking the list of the point's light tile.
//
// The includer declares, under these names, readonly buffers: `params.tiling` (TilingParams), `particles.particle[]`,
// `tile_heads.head[]`, `tile_nodes.node[]`. See lighting/sun.comp.
//
// Each occluder counts with its own extinction, density and fade. (Yusov's released code scales it by the receiver's
// density; src/reference/lighting.rs tests that we do not.)
#ifndef WELKIN_LIGHTING_SUN_OPTICAL_DEPTH
#define WELKIN_LIGHTING_SUN_OPTICAL_DEPTH
#include "tiling/tile.glsl"

// Lengths of the ray's way through the ellipsoid in front of three points on it: `reach` ahead of its start, the start,
// and `reach` behind it [m].
vec3 chords_ahead(Particle p, vec3 start, vec3 direction, float reach) {
    vec3 o_us = to_unit_ball(p, vec4(start, 1.0));
    vec3 d_us = to_unit_ball(p, vec4(direction, 0.0));
    // |o + t d|² = 1. The nearest point to the centre is found first: its distance does not cancel.
    float dd = dot(d_us, d_us);
    float t_nearest = -dot(o_us, d_us) / dd;
    vec3 nearest = o_us + t_nearest * d_us;
    float inside = 1.0 - dot(nearest, nearest);
    if (inside <= 0.0) return vec3(0.0);
    float half_chord = sqrt(inside / dd);
    vec3 from = vec3(reach, 0.0, -reach);
    return max(t_nearest + half_chord - from, 0.0) - max(t_nearest - half_chord - from, 0.0);
}

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
// list was left out.
vec3 sun_optical_depths(vec3 p_ws, float reach, uint self, out uint visited) {
    visited = 0u;
    vec3 start = lift_to_slab(p_ws, params.tiling);
    uint tile = receiver_tile(start, params.tiling);
    if (tile == NO_NODE) return vec3(0.0);
    float depth = light_depth(start, params.tiling);
    vec3 sum = vec3(0.0);
    uint node = tile_heads.head[tile];
    while (node != NO_NODE && ++visited <= params.tiling.traversal_limit) {
        TileNode entry = tile_nodes.node[node];
        // Front to back: from here on everything lies behind the receiver.
        if (key_depth(entry.key) < depth - reach - params.tiling.greatest_extent) break;
        if (entry.particle != self) {
            Particle p = particles.particle[entry.particle];
            sum += p.density * p.fade * chords_ahead(p, start, params.tiling.to_sun, reach);
        }
        node = entry.next;
    }
    return params.tiling.extinction * sum;
}

// For any point at all: on the ground, in the air, on a cloud.
float sun_optical_depth(vec3 p_ws) {
    uint visited;
    return sun_optical_depths(p_ws, 0.0, NO_NODE, visited).y;
}

#endif
