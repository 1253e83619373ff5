// Half a sweep of successive over-relaxation: voxels of one colour of the checkerboard.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lighting/tables/diffusion/params.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Volume { VolumeParams params; } volume;
layout(set = 0, binding = 1, std430) restrict buffer Light { vec2 voxel[]; } light;            // s, φ
layout(set = 0, binding = 2, std430) readonly restrict buffer Drive { vec2 voxel[]; } drive;   // a, q
layout(push_constant) uniform LevelPush {
    uint level;
    uint colour;             // 0 or 1
    float over_relaxation;   // 1 to 2
} push;

#include "lighting/tables/diffusion/place.glsl"

// What a neighbour gives and takes: conductance × φ, and conductance [1/m]. Between two voxels 1 / (3 s) is the harmonic mean.
vec2 exchange(vec2 there, float s, float inverse_distance2) {
    float conductance = 2.0 / 3.0 * inverse_distance2 / (s + there.x);
    return conductance * vec2(there.y, 1.0);
}

// What is lost to endless empty space through a face of the box, by Marshak's condition.
vec2 escape(float s, float size) {
    return vec2(0.0, 1.0 / (size * (1.5 * s * size + 2.0)));
}

// Beyond the box: the next coarser level, and around the coarsest one nothing.
vec2 beyond(ivec3 at, float s, float inverse_distance2) {
    if (push.level + 1u == volume.params.levels) return escape(s, volume.params.corner[push.level].z);
    return exchange(light.voxel[voxel_index(push.level + 1u, volume_parent(at, push.level))], s, inverse_distance2 / 1.5);
}

void main() {
    ivec3 at = ivec3(gl_GlobalInvocationID.xzy);
    at.x = 2 * at.x + ((at.y + at.z + int(push.colour)) & 1);
    int dim = int(volume.params.dim), layers = volume.params.stack[push.level].w;
    if (any(greaterThanEqual(at.xz, ivec2(dim)))) return;
    uint index = voxel_index(push.level, at);
    vec2 here = light.voxel[index], own = drive.voxel[index];
    float inverse_edge = volume.params.corner[push.level].w, height = volume_voxel_height(push.level);
    float across = inverse_edge * inverse_edge, up = 1.0 / (height * height), s = here.x;
    vec2 sum = own.yx;
    sum += at.x > 0 ? exchange(light.voxel[index - 1u], s, across) : beyond(at - ivec3(1, 0, 0), s, across);
    sum += at.x + 1 < dim ? exchange(light.voxel[index + 1u], s, across) : beyond(at + ivec3(1, 0, 0), s, across);
    sum += at.z > 0 ? exchange(light.voxel[index - dim], s, across) : beyond(at - ivec3(0, 0, 1), s, across);
    sum += at.z + 1 < dim ? exchange(light.voxel[index + dim], s, across) : beyond(at + ivec3(0, 0, 1), s, across);
    sum += at.y > 0 ? exchange(light.voxel[index - dim * dim], s, up) : escape(s, height);
    sum += at.y + 1 < layers ? exchange(light.voxel[index + dim * dim], s, up) : escape(s, height);
    light.voxel[index].y = mix(here.y, sum.x / sum.y, push.over_relaxation);
}
