// Every particle adds its matter, and how much of it the sun reaches, to the voxels that it covers: of the finest level
// that holds all of it, or of the coarsest. One thread a particle.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "compact/index.glsl"
#include "compact/view.glsl"
#include "grid/counters.glsl"
#include "lighting/tables/diffusion/params.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Volume { VolumeParams params; } volume;
layout(set = 0, binding = 1, std430) readonly restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 2, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 3, std430) readonly restrict buffer SunDepths { vec4 at[]; } sun_depths;
layout(set = 0, binding = 4, std430) restrict buffer Matter { uvec2 voxel[]; } matter;   // extinction; the same × sunlight

#include "lighting/tables/diffusion/place.glsl"

// Share of a ball's matter, projected on an axis, that lies below `u` radii from its centre, -1 to 1.
vec3 below(vec3 u) {
    return 0.5 + u * (0.75 - 0.25 * u * u);
}

// Whether a level holds all of an ellipsoid that reaches so far from its centre.
bool fits(vec3 centre, vec3 extent, uint level) {
    vec2 place = volume_place(centre, level), reach = extent.xz * volume.params.corner[level].w;
    return all(greaterThanEqual(place, reach)) && all(lessThanEqual(place + reach, vec2(volume.params.dim)));
}

void main() {
    uint index = linear_index();
    if (index >= counters.count.stored) return;
    Particle p = particles.particle[index];
    float sigma = volume.params.extinction * p.density * p.fade;
    if (sigma <= 0.0) return;

    vec3 extent = volume.params.body * vec3(ellipsoid_extent(p, vec3(1, 0, 0)), ellipsoid_extent(p, vec3(0, 1, 0)), ellipsoid_extent(p, vec3(0, 0, 1)));
    uint level = 0u;
    while (level + 1u < volume.params.levels && !fits(p.centre, extent, level)) ++level;
    float height = volume_voxel_height(level);
    vec2 place = volume_place(p.centre, level);
    vec3 at = vec3(place.x, volume_height(p.centre) * (volume.params.height / height), place.y);
    vec3 reach = extent * vec3(volume.params.corner[level].w, 1.0 / height, volume.params.corner[level].w);
    if (any(lessThanEqual(at.xz + reach.xz, vec2(0.0))) || any(greaterThanEqual(at.xz - reach.xz, vec2(volume.params.dim)))) return;

    float room = volume.params.corner[level].z * volume.params.corner[level].z * height;
    float mass = sigma * 4.18879020 * p.semi_axes.x * p.semi_axes.y * p.semi_axes.z / room * VOLUME_UNITS;
    // Optical depths count as those of isotropic scattering (similarity): what goes on forward has not been scattered.
    vec4 depth = (1.0 - volume.params.albedo * volume.params.asymmetry) * volume.params.shade * sun_depths.at[index];   // near pole, centre, far pole; own
    vec3 sun_us = to_unit_ball(p, vec4(volume.params.to_sun, 0.0));
    float per_metre = length(sun_us);
    // Along the light, in units of the way from the centre to a pole: 1 at the pole that faces it.
    vec3 along_sun = rotate(p.rotation, sun_us / (per_metre * p.semi_axes)) / volume.params.body * extent;
    // Half the optical depth of light's way through a box, by the lengths of its edges: the shortest of three ways.
    vec3 way_sun = 0.25 * (max(depth.z - depth.x, 0.0) + depth.w) * per_metre / volume.params.body * extent
                 / max(abs(volume.params.to_sun), 1e-4);

    // Slivers go to the voxels next to them, as matter above and below the box does: they hold next to nothing, and would be
    // a third of the work.
    vec3 core = max(reach - 0.25, 0.0);
    ivec3 most = ivec3(volume.params.dim, volume.params.stack[level].w, volume.params.dim) - 1;
    ivec3 first = clamp(ivec3(floor(at - core)), ivec3(0), most), last = clamp(ivec3(floor(at + core)), ivec3(0), most);
    vec3 inverse_reach = 1.0 / reach;
    ivec3 voxel = first;
    // One loop, not three in each other: threads of a subgroup wait for the longest of them alone.
    do {
        vec3 from = mix((vec3(voxel) - at) * inverse_reach, vec3(-1.0), equal(voxel, first));
        vec3 to = mix((vec3(voxel + 1) - at) * inverse_reach, vec3(1.0), equal(voxel, last));
        vec3 share = below(to) - below(from);
        float extinction = mass * share.x * share.y * share.z;
        // Sunlight at the middle of what the voxel has of the particle, averaged over the light's way through it.
        vec3 middle = 0.5 * (from + to);
        float along = clamp(dot(along_sun, middle), -1.0, 1.0), rest = max(1.0 - dot(middle, middle), 0.0);
        float tau = mix(depth.y, along > 0.0 ? depth.x : depth.z, abs(along))
                  + 0.5 * depth.w * max(sqrt(rest + along * along) - along, 0.0);
        vec3 ways = way_sun * (to - from);
        float way = max(min(ways.x, min(ways.y, ways.z)), 1e-3);
        float sunlight = exp(-max(tau - way, 0.0)) * (1.0 - exp(-2.0 * way)) / (2.0 * way);
        uint index = voxel_index(level, voxel);
        atomicAdd(matter.voxel[index].x, uint(extinction + 0.5));
        atomicAdd(matter.voxel[index].y, uint(extinction * sunlight + 0.5));
        bool row = voxel.x == last.x, layer = row && voxel.z == last.z;
        voxel = ivec3(row ? first.x : voxel.x + 1, voxel.y + int(layer), layer ? first.z : voxel.z + int(row));
    } while (voxel.y <= last.y);
}
