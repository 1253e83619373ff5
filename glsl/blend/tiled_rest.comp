#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// lighting: each
// Mode `tiled`: the pixels whose window overflowed, by the sweep that needs no window. One group for each half tile that
// has such pixels. Cost: segments are evaluated again for every batch of events.
#include "blend/tile_particle.glsl"
#include "blend/tiled_use.glsl"
#include "blend/bindings.glsl"
#include "blend/tiled_bindings.glsl"
#include "blend/segment.glsl"
layout(local_size_x = 32) in;
layout(push_constant) uniform TiledPush { uvec2 tiles; } push;

vec2 centre;
uint end;

bool sweep_valid(uint cursor) { return cursor < end; }
uint sweep_next(uint cursor) { return cursor + 1u; }
float sweep_floor(uint cursor) { return tile_particles.element[pair_particles.element[cursor]].bound; }
Segment sweep_segment(uint cursor, bool shaded) {
    TileParticle t = tile_particles.element[pair_particles.element[cursor]];
    if (conic_at(t.conic, centre - t.middle) > 1.0) return NO_SEGMENT;
    return particle_segment(t.particle, centre);
}
#include "blend/sweep.glsl"

void main() {
    uint slot = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (slot >= tiled_use.value.rest) return;
    uint half_tile = rest.word[2u * push.tiles.x * push.tiles.y + slot];
    uint lane = gl_LocalInvocationIndex;
    if ((rest.word[half_tile] >> lane & 1u) == 0u) return;
    uint tile = half_tile >> 1;
    uvec2 pixel = uvec2(tile % push.tiles.x, tile / push.tiles.x) * TILE + tile_pixel((half_tile & 1u) * 32u + lane);
    centre = vec2(pixel) + 0.5;
    end = tile_ranges.end[2u * tile + 1u];
    Sweep ray = sweep_from(tile_ranges.end[2u * tile], exp(-HIDDEN));
    store(ivec2(pixel), ray.radiance, ray.optical_depth, ray.nearest);
}
