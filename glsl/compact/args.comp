// Turns the count of visible particles into indirect dispatch and draw arguments. One thread.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid/counters.glsl"
#include "compact/groups.glsl"
layout(local_size_x = 1) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer ScanTotal { uint total; } scan_total;
layout(set = 0, binding = 1, std430) restrict buffer CountersBuffer { Counters count; } counters;
// draw: VkDrawIndirectCommand, one instance a particle.
layout(set = 0, binding = 2, std430) writeonly restrict buffer VisibleArgs { uvec4 visible; uvec4 sort; uvec4 draw; } visible_args;
layout(push_constant) uniform CompactArgsPush { uint vertices_per_particle; } push;

void main() {
    uint visible = scan_total.total;
    counters.count.visible = visible;
    visible_args.visible = groups_for(visible, 64u);
    visible_args.sort = groups_for(visible, 1024u);
    visible_args.draw = uvec4(push.vertices_per_particle, visible, 0u, 0u);
}
