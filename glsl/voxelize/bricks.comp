#version 460
// Mean extinction of the cloud over voxels, for other renderers; a brick of 8³ voxels at a time.
// In: a list of bricks, each with its run of `lists.entries`, the particles that touch it, in ascending order, so that sums
// do not depend on timing. Out: `values` [1/m], 512 a brick, z fastest (the order of an OpenVDB leaf).
// A workgroup is a slice of a brick, an invocation a voxel. Cost: the samples of every particle of the list that the voxel
// can meet.
#extension GL_GOOGLE_include_directive : require
#include "density/extinction.glsl"

layout(local_size_x = 64) in;

struct VoxelBrick {
    uint x, y, z;      // of its first voxel
    uint first;        // in lists.entries
    uint count;
};

layout(binding = 0, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 1, std430) restrict readonly buffer Bricks { VoxelBrick elements[]; } bricks;
layout(binding = 2, std430) restrict readonly buffer Lists { uint entries[]; } lists;
layout(binding = 3) uniform sampler3D detail_tile;
layout(binding = 4, std430) restrict writeonly buffer Values { float sigma_t[]; } values;
layout(push_constant) uniform VoxelPush {
    vec3  corner;      // of the first voxel, relative to the floating origin [m]
    float edge;        // of a voxel [m]
    vec3  origin;      // the floating origin [m]
    float sigma_t;     // [1/m]
    float detail;      // strength of the displacement
    uint  style;
    uint  seed;
    uint  samples;     // along each axis of a voxel, at least
} push;

// Nothing is too fine to be resolved: octaves that fade out would take the depth that they stand for along [m].
const float FOOTPRINT = 1e-3;
// Samples along an axis of a voxel for particles smaller than it, at most.
const uint MOST_SAMPLES = 16u;

// Mean profile of particle p over the voxel around `centre` (relative to the floating origin).
float mean_profile(Particle p, vec3 centre) {
    float least = min(p.semi_axes.x, min(p.semi_axes.y, p.semi_axes.z));
    vec3 middle_us = to_unit_ball(p, vec4(centre, 1.0));
    float distance_us = length(middle_us), reach = 0.8660254 * push.edge / least;      // half of a voxel's diagonal
    if (distance_us - reach > 1.0) return 0.0;
    if (push.style == PROFILE_HOMOGENEOUS && distance_us + reach < 1.0) return 1.0;
    // Two samples to a semi-axis, or particles smaller than voxels would be missed, or counted many times over.
    uint n = clamp(uint(ceil(2.0 * push.edge / least)), push.samples, max(push.samples, MOST_SAMPLES));
    float step = push.edge / float(n);
    vec3 x_us = to_unit_ball(p, vec4(step, 0.0, 0.0, 0.0));
    vec3 y_us = to_unit_ball(p, vec4(0.0, step, 0.0, 0.0));
    vec3 z_us = to_unit_ball(p, vec4(0.0, 0.0, step, 0.0));
    float middle = 0.5 * float(n - 1u), sum = 0.0;
    for (uint z = 0u; z < n; ++z)
    for (uint y = 0u; y < n; ++y)
    for (uint x = 0u; x < n; ++x) {
        vec3 p_us = middle_us + (float(x) - middle) * x_us + (float(y) - middle) * y_us + (float(z) - middle) * z_us;
        sum += displaced_profile(p, p_us, push.origin, detail_tile, push.detail, FOOTPRINT, push.style, push.seed);
    }
    return sum / float(n * n * n);
}

void main() {
    VoxelBrick brick = bricks.elements[gl_WorkGroupID.x];
    uvec3 local = uvec3(gl_WorkGroupID.y, gl_LocalInvocationID.x >> 3u, gl_LocalInvocationID.x & 7u);
    vec3 centre = push.corner + push.edge * (vec3(uvec3(brick.x, brick.y, brick.z) + local) + 0.5);
    float sum = 0.0;
    for (uint k = 0u; k < brick.count; ++k) {
        Particle p = particles.elements[lists.entries[brick.first + k]];
        sum += p.density * p.fade * mean_profile(p, centre);
    }
    values.sigma_t[gl_WorkGroupID.x * 512u + local.x * 64u + gl_LocalInvocationID.x] = push.sigma_t * sum;
}
