// Gives every stored particle the key that sorts it along the light, farthest from the light first. Slots run backwards,
// so that the stable sort leaves equal depths in descending order of particles: each goes to the head of its lists, which
// come out front to back with ties by ascending particle.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tiling/tile.glsl"
#include "tiling/occluder.glsl"
#include "grid/counters.glsl"
#include "compact/index.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer TilingParamsBuffer { TilingParams tiling; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 2, std430) readonly restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 3, std430) writeonly restrict buffer Keys { uint key[]; } keys;
layout(set = 0, binding = 4, std430) writeonly restrict buffer Indices { uint index[]; } indices;
layout(set = 0, binding = 5, std430) writeonly restrict buffer Occluders { Occluder by[]; } occluders;

void main() {
    uint index = linear_index();
    uint count = counters.count.stored;
    if (index >= count) return;
    uint slot = count - 1u - index;
    Particle p = particles.particle[index];
    occluders.by[index] = occluder_of(p, params.tiling);
    keys.key[slot] = ~light_key(light_depth(p.centre, params.tiling));
    indices.index[slot] = index;
}
