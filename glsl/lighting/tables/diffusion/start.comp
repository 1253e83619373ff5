// Coefficients of the diffusion equation, and a first guess at its solution: that of the next coarser level.
//
// Fluence φ [per irradiance of the sun] of the light that has been scattered (P1 approximation, similarity relation):
//     div (1 / (3 s) grad φ) - a φ + q = 0,   s = σ (1 - ϖ g),  a = σ (1 - ϖ),  q = ϖ (1 - g) σ exp(-τ_sun)
// Empty space has s = `vacuum`, and absorbs with a = ¾ s: then φ falls from a surface outwards as Marshak's condition for
// a surface that nothing shines on demands, -1/(3s) dφ/dn = φ / 2, and clouds that are no farther apart than 1/s still
// light each other.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lighting/tables/diffusion/params.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Volume { VolumeParams params; } volume;
layout(set = 0, binding = 1, std430) readonly restrict buffer Matter { uvec2 voxel[]; } matter;
layout(set = 0, binding = 2, std430) restrict buffer Light { vec2 voxel[]; } light;           // s, φ
layout(set = 0, binding = 3, std430) writeonly restrict buffer Drive { vec2 voxel[]; } drive; // a, q
layout(push_constant) uniform LevelPush {
    uint level;
    uint colour;
    float over_relaxation;
} push;

#include "lighting/tables/diffusion/place.glsl"

void main() {
    ivec3 at = ivec3(gl_GlobalInvocationID.xzy);
    if (any(greaterThanEqual(at.xz, ivec2(volume.params.dim)))) return;
    uint index = voxel_index(push.level, at);
    vec2 sigma = vec2(matter.voxel[index]) / VOLUME_UNITS;
    float reduced = sigma.x * (1.0 - volume.params.albedo * volume.params.asymmetry);
    float phi = 0.0;
    if (push.level + 1u < volume.params.levels) {
        phi = light.voxel[voxel_index(push.level + 1u, volume_parent(at, push.level))].y;
    }
    light.voxel[index] = vec2(max(reduced, volume.params.vacuum), phi);
    drive.voxel[index] = vec2(0.75 * max(volume.params.vacuum - reduced, 0.0) + sigma.x * (1.0 - volume.params.albedo),
                              volume.params.albedo * (1.0 - volume.params.asymmetry) * sigma.y);
}
