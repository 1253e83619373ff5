// What each visible particle shows of the light that others scatter: a linear function of the point that is seen, with value
// and slope of the linear interpolation in the middle of these points. Particles are smaller than voxels here and many
// pixels wide, so this replaces a look-up in each of their pixels. One thread a visible particle.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "common/frame.glsl"
#include "common/particle.glsl"
#include "compact/index.glsl"
#include "grid/counters.glsl"
#include "lighting/tables/diffusion/params.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Volume { VolumeParams params; } volume;
layout(set = 0, binding = 1, std430) readonly restrict buffer Frame { FrameParams params; } frame;
layout(set = 0, binding = 2, std430) readonly restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 3, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 4, std430) readonly restrict buffer Order { uint particle[]; } order;
layout(set = 0, binding = 5, std430) restrict buffer ParticleLights { ParticleLight light[]; } lights;
layout(set = 0, binding = 6, std430) readonly restrict buffer Radiance { float voxel[]; } radiance;

#include "lighting/tables/diffusion/place.glsl"
#include "lighting/tables/diffusion/seen.glsl"

const float RIM = 1.5;     // voxels at the border of a level that are not looked at
const float BLEND = 4.0;   // voxels next to these, over which a level passes into the next coarser one

// How far a position in a level lies from what is not looked at [voxels].
float inside(vec2 place) {
    return min(min(place.x, place.y), float(volume.params.dim) - max(place.x, place.y)) - RIM;
}

// Slope [1/(m sr)] and value [1/sr] of what one level holds.
vec4 interpolate(vec3 p_ws, uint level) {
    ivec3 size = ivec3(volume.params.dim, volume.params.stack[level].w, volume.params.dim);
    vec2 place = volume_place(p_ws, level);
    float height = ldexp(volume_height(p_ws), -volume_doublings(level));
    vec3 at = clamp(vec3(place.x, height, place.y), vec3(0.5), vec3(size) - 0.5) - 0.5;
    ivec3 first = min(ivec3(at), size - 2);
    vec3 t = at - vec3(first);
    uint row = volume.params.dim, layer = row * row, index = voxel_index(level, first);
    // Two neighbours along x each: at the lower and the upper corners along y and z.
    vec2 v00 = vec2(radiance.voxel[index], radiance.voxel[index + 1u]);
    vec2 v01 = vec2(radiance.voxel[index + row], radiance.voxel[index + row + 1u]);
    vec2 v10 = vec2(radiance.voxel[index + layer], radiance.voxel[index + layer + 1u]);
    vec2 v11 = vec2(radiance.voxel[index + layer + row], radiance.voxel[index + layer + row + 1u]);
    vec2 v0 = mix(v00, v01, t.z), v1 = mix(v10, v11, t.z), v = mix(v0, v1, t.y), along_z = mix(v01 - v00, v11 - v10, t.y);
    vec3 slope = vec3(v.y - v.x, mix(v1.x - v0.x, v1.y - v0.y, t.x), mix(along_z.x, along_z.y, t.x));
    float inverse_edge = volume.params.corner[level].w;
    return vec4(slope * vec3(inverse_edge, 1.0 / volume_voxel_height(level), inverse_edge), mix(v.x, v.y, t.x));
}

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

    uint level = 0u, last = volume.params.levels - 1u;
    float own = inside(volume_place(middle, level));
    while (own <= 0.0 && level < last) own = inside(volume_place(middle, ++level));
    vec4 fit = interpolate(middle, level);
    if (own < BLEND && level < last) fit = mix(interpolate(middle, level + 1u), fit, own / BLEND);
    lights.light[index].others = crowd * vec4(fit.xyz, fit.w - dot(fit.xyz, middle));
}
