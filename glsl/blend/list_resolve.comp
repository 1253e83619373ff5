#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Mode `list`: sorts the segments of each pixel by entry, ties by particle, and integrates them exactly. One thread a pixel.
// Sums are taken in sorted order, so the result does not depend on the order in which fragments ran.
#include "blend/list.glsl"
#include "blend/merge.glsl"
#include "grid/counters.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, std430) restrict readonly buffer ListHeads { uint node[]; } list_heads;
layout(binding = 1, std430) restrict buffer ListNodes { SegmentNode element[]; } list_nodes;
layout(binding = 2, std430) restrict readonly buffer ListUse { uint nodes; } list_use;
layout(binding = 3, std430) restrict buffer CountersBuffer { Counters count; } counters;
layout(binding = 4) restrict writeonly uniform image2D cloud;      // in-scattered radiance, transmittance
layout(binding = 5) restrict writeonly uniform image2D nearest;    // distance to the first cloud [m]
layout(push_constant) uniform ListResolvePush { uint first_row; uint end_row; } push;

uint list_next(uint node) { return list_nodes.element[node].next; }
void list_link(uint node, uint next) { list_nodes.element[node].next = next; }
bool list_before(uint a, uint b) {
    float enter_a = list_nodes.element[a].t_enter, enter_b = list_nodes.element[b].t_enter;
    return enter_a != enter_b ? enter_a < enter_b : list_nodes.element[a].particle < list_nodes.element[b].particle;
}
#include "compact/list_sort.glsl"

bool sweep_valid(uint node) { return node != NO_NODE; }
uint sweep_next(uint node) { return list_nodes.element[node].next; }
float sweep_floor(uint node) { return list_nodes.element[node].t_enter; }
Segment sweep_segment(uint node, bool shaded) {
    SegmentNode n = list_nodes.element[node];
    return Segment(n.colour, n.optical_depth, n.t_enter, n.t_exit);
}
#include "blend/sweep.glsl"

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, push.first_row);
    // The longest need of all bands of rows that share the nodes.
    if (gl_GlobalInvocationID.xy == uvec2(0u)) counters.count.blend_nodes = max(counters.count.blend_nodes, list_use.nodes);
    ivec2 size = imageSize(cloud);
    if (pixel.x >= size.x || pixel.y >= int(push.end_row)) return;
    uint head = list_heads.node[pixel.y * size.x + pixel.x];
    Sweep ray = sweep_from(list_sort(head), 0.0);
    imageStore(cloud, pixel, vec4(ray.radiance, exp(-ray.optical_depth)));
    imageStore(nearest, pixel, vec4(ray.nearest));
}
