#version 460
#extension GL_GOOGLE_include_directive : require
// Blends the segments of explicit rays, one ray an invocation, by the merges that the blend modes use.
layout(local_size_x = 64) in;
layout(constant_id = 2) const uint WINDOW = 2;   // 1: the merge of the paper
#include "blend/window.glsl"
layout(binding = 0, std430) restrict readonly buffer Rays { Segment segments[]; } rays;
layout(binding = 1, std430) restrict writeonly buffer Composites { vec4 elements[]; } composites;   // radiance, transmittance
layout(push_constant) uniform ProbePush { uint ray_count; uint segment_count; };

void main() {
    uint ray = gl_GlobalInvocationID.x;
    if (ray >= ray_count) return;
    Committed committed = Committed(vec3(0.0), 0.0);
    Segment window[WINDOW];
    for (uint i = 0u; i < WINDOW; ++i) window[i] = NO_SEGMENT;
    for (uint i = 0u; i < segment_count; ++i) {
        Segment incoming = rays.segments[ray * segment_count + i];
        if (WINDOW == 1u) merge(window[0], committed, incoming);
        else insert(window, committed, incoming);
    }
    composites.elements[ray] = vec4(resolve_window(window, committed), exp(-committed.optical_depth));
}
