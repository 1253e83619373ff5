// Where a point lies in the volume, and where a voxel lies in memory. The includer declares, under this name, the readonly
// buffer `volume.params` (VolumeParams).
#ifndef WELKIN_VOLUME_PLACE
#define WELKIN_VOLUME_PLACE
#include "lighting/tables/diffusion/params.glsl"

uint voxel_index(uint level, ivec3 voxel) {
    return (uint(volume.params.stack[level].z + voxel.y) * volume.params.dim + uint(voxel.z)) * volume.params.dim + uint(voxel.x);
}

// How often the height of a level's voxels has doubled.
int volume_doublings(uint level) {
    return max(int(level) - 1, 0);
}

// The voxel of the next coarser level that a voxel lies in.
ivec3 volume_parent(ivec3 voxel, uint level) {
    ivec2 begin = volume.params.stack[level + 1u].xy;
    int y = voxel.y >> (volume_doublings(level + 1u) - volume_doublings(level));
    return ivec3((voxel.x >> 1) + begin.x, y, (voxel.z >> 1) + begin.y);
}

float volume_voxel_height(uint level) {
    return ldexp(volume.params.height, volume_doublings(level));
}

// Height above the lower faces [voxels of the finest level].
float volume_height(vec3 p_ws) {
    vec2 d = p_ws.xz - volume.params.bend;
    return (p_ws.y - volume.params.base + dot(d, d) * volume.params.inverse_diameter) / volume.params.height;
}

// Position in a level [voxels].
vec2 volume_place(vec3 p_ws, uint level) {
    return (p_ws.xz - volume.params.corner[level].xy) * volume.params.corner[level].w;
}

#endif
