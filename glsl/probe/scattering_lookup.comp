#version 460
// Looks the scattering table up for each ray of a list: what the renderer sees, for tests.
// In: rays in the unit ball, the table. Out: mean source functions of single and of multiple scattering.
#extension GL_GOOGLE_include_directive : require
#include "lut/scattering_lookup.glsl"

struct LookupRay { vec3 entry; float optical_radius; vec3 dir; float pad_a; vec3 to_sun; float pad_b; };

layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer Rays { LookupRay at[]; } rays;
layout(binding = 1, std430) restrict writeonly buffer Found { vec2 at[]; } found;
layout(binding = 2) uniform sampler3D table;
layout(push_constant) uniform LookupPush { uint count; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= count) return;
    LookupRay ray = rays.at[index];
    found.at[index] = scattering_source_lookup(table, ray.entry, ray.dir, ray.to_sun, ray.optical_radius);
}
