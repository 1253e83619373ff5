// Sunlight that reaches the centre of every particle, as transmittance. One thread a particle. Yusov 5.3, step 2.
// Particles outside the view are lit too: smoothing reads them, and light must not change when the camera turns.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tiling/tile.glsl"
#include "grid/counters.glsl"
#include "compact/index.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer TilingParamsBuffer { TilingParams tiling; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 2, std430) readonly restrict buffer TileHeads { uint head[]; } tile_heads;
layout(set = 0, binding = 3, std430) readonly restrict buffer TileNodes { TileNode node[]; } tile_nodes;
layout(set = 0, binding = 4, std430) restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 5, std430) writeonly restrict buffer SunTransmittance { float transmittance[]; } sun;
#include "lighting/sun_optical_depth.glsl"

void main() {
    uint index = linear_index();
    if (index >= counters.count.stored) return;
    uint visited;
    float optical_depth = sun_optical_depth_of(particles.particle[index].centre, index, visited);
    atomicMax(counters.count.longest_walk, visited);
    if (visited > params.tiling.traversal_limit) atomicAdd(counters.count.truncated, 1u);
    sun.transmittance[index] = exp(-optical_depth);
}
