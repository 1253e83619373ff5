// Sums along the light, twice: slopes from bends, and optical depths in front of the middles of voxels from slopes. One
// thread a column.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lighting/attenuation/params.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Attenuation { AttenuationParams params; } attenuation;
layout(set = 0, binding = 1, r32ui) readonly restrict uniform uimage3D bends;
layout(set = 0, binding = 2) writeonly restrict uniform image3D attenuation_volume;

void main() {
    uvec3 column = gl_GlobalInvocationID;
    if (any(greaterThanEqual(column.xy, uvec2(attenuation.params.dim)))) return;
    int slope = 0, depth = int(attenuation.params.depth);
    float tau = 0.0;
    for (int k = 0; k < depth; ++k) {
        ivec3 at = ivec3(column.xy, int(column.z) * depth + k);
        slope += int(imageLoad(bends, at).x);
        tau += float(slope) * (1.0 / ATTENUATION_UNITS);
        imageStore(attenuation_volume, at, vec4(clamp(tau, 0.0, 6e4)));   // f16 ends at 65504
    }
}
