#version 460
#extension GL_GOOGLE_include_directive : require
// vertex: blend/particle.vert
// lighting: each
// Mode `list`: every segment goes into the list of its pixel, in whatever order fragments run; list_resolve.comp sorts and
// integrates. Needs no ordering at all. Cost: two atomics and 32 bytes written a fragment.
#include "blend/list.glsl"
#include "blend/bindings.glsl"
layout(binding = 9, std430) restrict buffer ListHeads { uint node[]; } list_heads;
layout(binding = 10, std430) restrict writeonly buffer ListNodes { SegmentNode element[]; } list_nodes;
layout(binding = 11, std430) restrict buffer ListUse { uint nodes; } list_use;   // counts past capacity
#include "blend/segment.glsl"
layout(location = 0) flat in uint particle_index;
layout(push_constant) uniform ListPush { uint capacity; } push;

void main() {
    Segment s = particle_segment(particle_index, gl_FragCoord.xy);
    if (s.optical_depth <= 0.0) return;
    uint node = atomicAdd(list_use.nodes, 1u);
    if (node >= push.capacity) return;
    uint pixel = uint(gl_FragCoord.y) * frame.params.low_width + uint(gl_FragCoord.x);
    uint next = atomicExchange(list_heads.node[pixel], node);
    list_nodes.element[node] = SegmentNode(s.colour, s.optical_depth, s.t_enter, s.t_exit, particle_index, next);
}
