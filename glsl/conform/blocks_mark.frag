#version 460
// vertex: conform/blocks_mark.vert
// Each fragment counts for its instance.
layout(location = 0) flat in uint instance;
layout(binding = 0, std430) restrict buffer MarkVisits { uint count[]; } visits;   // [0]: instances beyond the list

void main() {
    atomicAdd(visits.count[instance + 1u < visits.count.length() ? instance + 1u : 0u], 1u);
}
