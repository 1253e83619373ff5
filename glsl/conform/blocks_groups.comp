#version 460
// Each work group leaves a mark at its place in the dispatch.
#extension GL_GOOGLE_include_directive : require
#include "conform/blocks.glsl"
layout(local_size_x = 4) in;

layout(binding = 0, std430) restrict buffer GroupVisits { uint count[]; } visits;   // [0]: groups beyond the list

void main() {
    uvec3 id = gl_WorkGroupID, n = gl_NumWorkGroups;
    uint group = id.x + n.x * (id.y + n.y * id.z) + 1u;
    atomicAdd(visits.count[group < visits.count.length() ? group : 0u], 1u);
}
