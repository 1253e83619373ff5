// The solution as an image that can be filtered: x, z, and the layers of all levels one above the other.
// Towards its border a level passes into the next coarser one, so that a look-up needs one of them alone.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "volume/params.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Volume { VolumeParams params; } volume;
layout(set = 0, binding = 1, std430) readonly restrict buffer Light { vec2 voxel[]; } light;
layout(set = 0, binding = 2, std430) readonly restrict buffer Matter { uvec2 voxel[]; } matter;
layout(set = 0, binding = 3, std430) writeonly restrict buffer Radiance { float voxel[]; } radiance;   // the same as numbers
layout(set = 0, binding = 4, r16f) writeonly restrict uniform image3D light_volume;

#include "volume/place.glsl"

const float BLEND = 4.0;   // voxels over which a level passes into the next coarser one, before that is looked at instead

// What a voxel shines with, times 4π: the fluence of scattered light, and a share of what the sun scatters in it for the first
// time. Diffusion knows the mean of that over the voxel; where the voxel is optically thick, it is all at the sunlit side,
// and seen there.
float shine(ivec3 voxel, uint level) {
    uint index = voxel_index(level, voxel);
    vec2 sigma = vec2(matter.voxel[index]) / VOLUME_UNITS, s_phi = light.voxel[index];
    float thickness = s_phi.x * volume.params.corner[level].z, thickness2 = thickness * thickness;
    return s_phi.y + thickness2 / (1.0 + thickness2) * sigma.y / max(sigma.x, volume.params.vacuum);
}

// The same of the next coarser level, filtered linearly at the middle of a voxel.
float coarser_shine(ivec3 at, uint level) {
    ivec3 parent = volume_parent(at, level), side = 2 * (at & 1) - 1;   // a quarter of the parent's edge from its middle
    bool higher = volume_doublings(level + 1u) > volume_doublings(level);
    int next = higher ? clamp(parent.y + side.y, 0, volume.params.stack[level + 1u].w - 1) : parent.y;
    float sum = 0.0;
    for (int k = 0; k < 4; ++k) {
        ivec2 xz = parent.xz + ivec2(k & 1, k >> 1) * side.xz;
        float weight = ((k & 1) == 0 ? 0.75 : 0.25) * (k < 2 ? 0.75 : 0.25);
        sum += weight * mix(shine(ivec3(xz.x, parent.y, xz.y), level + 1u), shine(ivec3(xz.x, next, xz.y), level + 1u), 0.25);
    }
    return sum;
}

void main() {
    uvec3 at = gl_GlobalInvocationID;
    if (any(greaterThanEqual(at.xy, uvec2(volume.params.dim)))) return;
    uint level = 0u;
    while (int(at.z) >= volume.params.stack[level].z + volume.params.stack[level].w) ++level;
    ivec3 voxel = ivec3(at.x, int(at.z) - volume.params.stack[level].z, at.y);
    float four_pi_radiance = shine(voxel, level);
    // A look-up filters half a voxel farther out.
    vec2 middle = abs((vec2(at.xy) + 0.5) / float(volume.params.dim) - 0.5);
    float own = ((volume.params.rim - max(middle.x, middle.y)) * float(volume.params.dim) - 0.5) / BLEND;
    if (own < 1.0 && level + 1u < volume.params.levels) {
        four_pi_radiance = mix(coarser_shine(voxel, level), four_pi_radiance, max(own, 0.0));
    }
    float here = max(four_pi_radiance, 0.0) * 0.07957747154594767;
    radiance.voxel[voxel_index(level, voxel)] = here;
    imageStore(light_volume, ivec3(at), vec4(here));
}
