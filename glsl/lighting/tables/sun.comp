// Sunlight that reaches every particle, at three points on the ray through its centre: the pole that faces the sun, the
// centre, the far pole. One walk of the list serves all three. One thread a particle. Yusov 5.3, step
// 2, which knows the centre alone; with three, overlapping particles agree on the light between them.
// Particles outside the view are lit too: smoothing reads them, and light must not change when the camera turns.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tiling/tile.glsl"
#include "grid/counters.glsl"
#include "compact/index.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer TilingParamsBuffer { TilingParams tiling; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer Occluders { Occluder by[]; } occluders;
layout(set = 0, binding = 2, std430) readonly restrict buffer TileHeads { uint head[]; } tile_heads;
layout(set = 0, binding = 3, std430) readonly restrict buffer TileNodes { TileNode node[]; } tile_nodes;
layout(set = 0, binding = 4, std430) restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 5, std430) writeonly restrict buffer SunLight { ParticleLight at[]; } sun;
layout(set = 0, binding = 6, std430) writeonly restrict buffer SunDepths { vec4 at[]; } sun_depths;
layout(push_constant) uniform SunPush {
    float xi;          // clouds.xi
    uint  transfer;    // TRANSFER_*
    float voxel;       // edge of the finest voxels in which light diffuses [m]
} push;
#include "lighting/tables/transfer.glsl"
#include "lighting/sun_optical_depth.glsl"

void main() {
    uint index = linear_index();
    if (index >= counters.count.stored) return;
    uint visited;
    Occluder particle = occluders.by[index];
    float reach = particle.half_chord;
    vec3 optical_depths = sun_optical_depths(particle.centre, reach, index, visited);
    atomicMax(counters.count.longest_walk, visited);
    if (visited > params.tiling.traversal_limit) atomicAdd(counters.count.truncated, 1u);
    float own = 2.0 * reach * params.tiling.extinction * particle.density;
    SunShares shares = sun_shares(optical_depths, own, push.xi, push.voxel / reach, push.transfer);
    sun.at[index] = ParticleLight(shares.diffuse, 1.0, shares.direct, shares.crowd, vec4(0.0));
    sun_depths.at[index] = vec4(optical_depths, own);
}
