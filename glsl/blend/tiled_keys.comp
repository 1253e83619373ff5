#version 460
#extension GL_GOOGLE_include_directive : require
// Mode `tiled`: the distance before which no ray enters a visible particle, as the key that particles are sorted by.
#include "blend/tile_particle.glsl"
#include "blend/tiled_use.glsl"
#include "compact/index.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 1, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 2, std430) restrict readonly buffer Order { uint indices[]; } order;
layout(binding = 3, std430) restrict readonly buffer TiledUseBuffer { TiledUse value; } tiled_use;
layout(binding = 4, std430) restrict writeonly buffer Keys { uint key[]; } keys;
layout(binding = 5, std430) restrict writeonly buffer Indices { uint index[]; } indices;

void main() {
    uint i = linear_index();
    if (i >= tiled_use.value.particles) return;
    uint index = order.indices[i];
    keys.key[i] = distance_key(entry_bound(frame.params, particles.elements[index]));
    indices.index[i] = index;
}
