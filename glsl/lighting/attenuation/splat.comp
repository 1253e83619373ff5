// Every particle dims the columns of voxels behind it, in any order. Between the light and the middle of a voxel its optical
// depth is 0, then grows evenly, then stays: of such a ramp the differences of differences along the light are 0 but at both
// ends, and these are all that is added to a column; store.comp sums twice. (Shimada adds the particle to every voxel behind
// it.) Eight threads a particle, each with every eighth of its columns.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "compact/index.glsl"
#include "grid/counters.glsl"
#include "lighting/attenuation/shadow.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Attenuation { AttenuationParams params; } attenuation;
layout(set = 0, binding = 1, std430) readonly restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 2, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 3, r32ui) restrict uniform uimage3D bends;   // second differences, two's complement

const uint TEAM = 8u;

void bend(ivec3 at, int units) {
    if (units != 0) imageAtomicAdd(bends, at, uint(units));
}

// `column`: begin and end [voxels], optical depth.
void add_ramp(ivec2 at, vec3 column, int first_layer) {
    int total = int(column.z * ATTENUATION_UNITS + 0.5);
    if (total == 0) return;
    // In middles of voxels. Matter above and below the box counts as matter at its faces; two voxels after the last with
    // a begin take the bends.
    float last = float(attenuation.params.depth - 3u);
    float begin = clamp(column.x - 0.5, 0.0, last), end = clamp(column.y - 0.5, begin, last);
    int from = int(floor(begin)) + 1, to = max(int(ceil(end)), from);   // first voxel with any, first voxel with all of it
    ivec3 place = ivec3(at, first_layer + from);
    if (to == from) {
        bend(place, total);
        bend(place + ivec3(0, 0, 1), -total);
        return;
    }
    float slope = column.z * ATTENUATION_UNITS / (end - begin);
    int first = int((float(from) - begin) * slope + 0.5), even = int(slope + 0.5);
    int rest = total - first - even * (to - from - 1);   // so that the sum is exact
    bend(place, first);
    if (to == from + 1) {
        bend(place + ivec3(0, 0, 1), rest - first);
    } else {
        bend(place + ivec3(0, 0, 1), even - first);
        bend(ivec3(at, first_layer + to), rest - even);
    }
    bend(ivec3(at, first_layer + to + 1), -rest);
}

void main() {
    uint lane = gl_LocalInvocationIndex % TEAM, team = gl_LocalInvocationIndex / TEAM;
    for (uint round = 0u; round < TEAM; ++round) {
        uint index = linear_group() * 64u + round * (64u / TEAM) + team;
        if (index >= counters.count.stored) return;
        Particle p = particles.particle[index];
        if (p.density * p.fade <= 0.0) continue;
        for (uint level = 0u; level < attenuation.params.levels; ++level) {
            Shadow s = particle_shadow(p, level, attenuation.params);
            ivec2 least = max(ivec2(ceil(s.centre.xy - s.reach - 0.5)), ivec2(0));
            ivec2 most = min(ivec2(floor(s.centre.xy + s.reach - 0.5)), ivec2(attenuation.params.dim) - 1);
            ivec2 size = most - least + 1;
            if (any(lessThanEqual(size, ivec2(0)))) continue;
            int columns = size.x * size.y, first_layer = int(level * attenuation.params.depth);
            for (int i = int(lane); i < columns; i += int(TEAM)) {
                ivec2 at = least + ivec2(i % size.x, i / size.x);
                vec3 column = shadow_column(s, vec2(at) + 0.5);
                if (column.z > 0.0) add_ramp(at, column, first_layer);
            }
        }
    }
}
