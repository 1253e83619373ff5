// What each visible particle shows of the light that others scatter: a linear function of the point that is seen, with value
// and slope of the trilinear interpolation in the middle of these points. Particles are smaller than voxels here and many
// pixels wide, so this replaces a look-up in each of their pixels. One thread a visible particle.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "common/frame.glsl"
#include "common/particle.glsl"
#include "compact/index.glsl"
#include "grid/counters.glsl"
#include "volume/params.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Volume { VolumeParams params; } volume;
layout(set = 0, binding = 1, std430) readonly restrict buffer Frame { FrameParams params; } frame;
layout(set = 0, binding = 2, std430) readonly restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 3, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 4, std430) readonly restrict buffer Order { uint particle[]; } order;
layout(set = 0, binding = 5, std430) restrict buffer ParticleLights { ParticleLight light[]; } lights;
layout(set = 0, binding = 6, std430) readonly restrict buffer Radiance { float voxel[]; } radiance;

#include "volume/lookup.glsl"
#include "volume/seen.glsl"

void main() {
    uint item = linear_index();
    if (item >= counters.count.visible) return;
    uint index = order.particle[item];
    float crowd = lights.light[index].crowd;
    if (crowd <= 0.0) return;
    Particle p = particles.particle[index];
    vec3 view = normalize(p.centre - frame.params.camera);
    float half_chord = 1.0 / length(to_unit_ball(p, vec4(view, 0.0)));
    float extinction = frame.params.sigma_t * p.density * p.fade * frame.params.fill;
    vec3 middle = p.centre + (seen_depth(extinction) - half_chord) * view;

    vec2 across;
    int level = volume_level(middle, across);
    vec3 size = vec3(volume.params.dim, volume.params.layers, volume.params.dim);
    vec3 at = vec3(across.x, volume_up(middle, level), across.y) * size - 0.5;
    ivec3 first = clamp(ivec3(floor(at)), ivec3(0), ivec3(size) - 2);
    vec3 t = clamp(at - vec3(first), 0.0, 1.0);
    int row = int(volume.params.dim), index_000 = (first.y * row + first.z) * row + first.x;
    // Values at the corners: x → components, y and z in the names.
    vec2 v00, v10, v01, v11;
    for (int x = 0; x < 2; ++x) {
        v00[x] = radiance.voxel[index_000 + x];
        v01[x] = radiance.voxel[index_000 + x + row];
        v10[x] = radiance.voxel[index_000 + x + row * row];
        v11[x] = radiance.voxel[index_000 + x + row * row + row];
    }
    vec2 v0 = mix(v00, v01, t.z), v1 = mix(v10, v11, t.z), v = mix(v0, v1, t.y);
    vec2 along_z = mix(v01 - v00, v11 - v10, t.y);
    vec3 slope = vec3(v.y - v.x, mix(v1.x - v0.x, v1.y - v0.y, t.x), mix(along_z.x, along_z.y, t.x));
    vec3 per_metre = size * vec3(volume.params.across[level].z, volume.params.up[level].y, volume.params.across[level].z);
    vec3 gradient = slope * per_metre;
    lights.light[index].others = crowd * vec4(gradient, mix(v.x, v.y, t.x) - dot(gradient, middle));
}
