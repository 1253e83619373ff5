// The solution as radiance: as numbers for diffusion/seen.comp, or, where particles are larger than voxels, as an image that
// every pixel filters: x, z, and the layers one above the other.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lighting/tables/diffusion/params.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Volume { VolumeParams params; } volume;
layout(set = 0, binding = 1, std430) readonly restrict buffer Light { vec2 voxel[]; } light;
layout(set = 0, binding = 2, std430) readonly restrict buffer Matter { uvec2 voxel[]; } matter;
layout(set = 0, binding = 3, std430) writeonly restrict buffer Radiance { float voxel[]; } radiance;
layout(set = 0, binding = 4, r16f) writeonly restrict uniform image3D light_volume;

void main() {
    uvec3 at = gl_GlobalInvocationID;
    if (any(greaterThanEqual(at.xy, uvec2(volume.params.dim)))) return;
    uint level = 0u;
    while (int(at.z) >= volume.params.stack[level].z + volume.params.stack[level].w) ++level;
    uint index = (at.z * volume.params.dim + at.y) * volume.params.dim + at.x;
    vec2 sigma = vec2(matter.voxel[index]) / VOLUME_UNITS, s_phi = light.voxel[index];
    // Beside the fluence of scattered light, a share of what the sun scatters here for the first time. Diffusion knows the
    // mean of that over the voxel; where the voxel is optically thick, it is all at the sunlit side, and seen there. A small
    // cloud in a large voxel, which has little fluence for the light that falls in, loses it at its other sides.
    float thickness = s_phi.x * volume.params.corner[level].z, thickness2 = thickness * thickness;
    float sunlight = sigma.y / max(sigma.x, volume.params.vacuum);
    float fluence = s_phi.y + thickness2 / (1.0 + thickness2) * min(sunlight, 0.5 * s_phi.y);
    float value = max(fluence, 0.0) * 0.07957747154594767;   // / 4π
    radiance.voxel[index] = value;
    if (volume.params.fitted == 0u) imageStore(light_volume, ivec3(at), vec4(value));
}
