// Where a level has a finer one inside, its voxels get the mean of the four or eight voxels there.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lighting/tables/diffusion/params.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Volume { VolumeParams params; } volume;
layout(set = 0, binding = 1, std430) restrict buffer Matter { uvec2 voxel[]; } matter;
layout(push_constant) uniform ReducePush {
    uint level;   // the coarse one, from 1
} push;

#include "lighting/tables/diffusion/place.glsl"

void main() {
    ivec3 at = ivec3(gl_GlobalInvocationID.xzy);
    if (any(greaterThanEqual(at.xz, ivec2(volume.params.dim / 2u)))) return;
    uint finer = push.level - 1u;
    int rise = volume_doublings(push.level) - volume_doublings(finer);   // 0 or 1
    uvec2 sum = uvec2(0);
    for (int y = at.y << rise; y < min((at.y + 1) << rise, volume.params.stack[finer].w); ++y)
        for (int k = 0; k < 4; ++k) sum += matter.voxel[voxel_index(finer, ivec3(2 * at.x + (k & 1), y, 2 * at.z + (k >> 1)))];
    ivec3 here = ivec3(at.x + volume.params.stack[push.level].x, at.y, at.z + volume.params.stack[push.level].y);
    // What particles that do not fit into the finer level have put here stays.
    matter.voxel[voxel_index(push.level, here)] += sum >> (2 + rise);
}
