#version 460
#extension GL_GOOGLE_include_directive : require
// The rectangle of tiles that a particle covers in one of its levels; a pixel is a tile, levels lie below one another.
// Particles come farthest from the light first.
#include "tiling/tile.glsl"
layout(set = 0, binding = 0, std430) readonly restrict buffer TilingParamsBuffer { TilingParams tiling; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 2, std430) readonly restrict buffer LightOrder { uint index[]; } light_order;
layout(location = 0) flat out uint particle_index;

void main() {
    uint share = params.tiling.levels_per_particle;
    particle_index = light_order.index[uint(gl_InstanceIndex) / share];
    Particle p = particles.particle[particle_index];
    gl_Position = vec4(2.0, 2.0, 0.5, 1.0); // nothing
    uint levels = params.tiling.level_count, skip = uint(gl_InstanceIndex) % share, level = 0u;
    for (; level < levels; ++level) {
        if (in_level(p, level, params.tiling) && skip-- == 0u) break;
    }
    if (level == levels) return;
    TileRange tiles = footprint_tiles(footprint(p, level, params.tiling), params.tiling);
    if (any(lessThan(tiles.greatest, tiles.least))) return;
    ivec2 corner = ivec2(gl_VertexIndex & 1, gl_VertexIndex >> 1);
    ivec2 tile = mix(tiles.least, tiles.greatest + 1, equal(corner, ivec2(1)));
    vec2 size = vec2(float(params.tiling.tile_dim), float(params.tiling.tile_dim * levels));
    vec2 at = vec2(tile) + vec2(0.0, float(level * params.tiling.tile_dim));
    gl_Position = vec4(at / size * 2.0 - 1.0, 0.5, 1.0);
}
