#version 460
#extension GL_GOOGLE_include_directive : require
// Mode `tiled`: silhouette of each visible particle, in the order of entry bounds, and how many tiles it touches.
#include "blend/tile_particle.glsl"
#include "blend/tiled_use.glsl"
#include "compact/index.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 1, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 2, std430) restrict readonly buffer TiledUseBuffer { TiledUse value; } tiled_use;
layout(binding = 3, std430) restrict readonly buffer Keys { uint key[]; } keys;
layout(binding = 4, std430) restrict readonly buffer Indices { uint index[]; } indices;
layout(binding = 5, std430) restrict writeonly buffer TileParticles { TileParticle element[]; } tile_particles;
layout(binding = 6, std430) restrict writeonly buffer Counts { uint count[]; } counts;
layout(push_constant) uniform TiledCountPush { ivec2 tiles; } push;

void main() {
    uint i = linear_index();
    if (i >= tiled_use.value.particles) return;
    uint index = indices.index[i];
    TileParticle t = tile_particle(frame.params, particles.elements[index], index, key_distance(keys.key[i]));
    tile_particles.element[i] = t;
    ivec4 range = tile_range(t, push.tiles);
    bool everywhere = t.conic == vec3(0.0);
    uint count = everywhere ? uint(push.tiles.x * push.tiles.y) : 0u;
    if (!everywhere) for (int y = range.y; y <= range.w; ++y)
        for (int x = range.x; x <= range.z; ++x)
            if (touches(t, ivec2(x, y))) ++count;
    counts.count[i] = count;
}
