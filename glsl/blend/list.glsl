// Per-pixel lists of segments. Twin: src/blend/list.rs.
#ifndef BLEND_LIST
#define BLEND_LIST

const uint NO_NODE = 0xffffffffu;

struct SegmentNode {
    vec3  colour;
    float optical_depth;
    float t_enter;         // [m]
    float t_exit;
    uint  particle;        // breaks ties
    uint  next;
};

#endif
