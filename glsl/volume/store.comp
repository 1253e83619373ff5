// The solution as an image that can be filtered: x, z, and the layers of all levels one above the other.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "volume/params.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Volume { VolumeParams params; } volume;
layout(set = 0, binding = 1, std430) readonly restrict buffer Light { vec2 voxel[]; } light;
layout(set = 0, binding = 2, r16f) writeonly restrict uniform image3D light_volume;

void main() {
    uvec3 at = gl_GlobalInvocationID;
    if (any(greaterThanEqual(at.xy, uvec2(volume.params.dim)))) return;
    float phi = light.voxel[(at.z * volume.params.dim + at.y) * volume.params.dim + at.x].y;
    imageStore(light_volume, ivec3(at), vec4(max(phi, 0.0) * 0.07957747154594767)); // / 4π: radiance
}
