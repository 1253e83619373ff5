#version 460
#extension GL_GOOGLE_include_directive : require
// vertex: conform/layers.vert
// Welkin's own merge (blend/merge.glsl) in the attachments that mode `attachment` has.
#include "conform/segments.glsl"
layout(input_attachment_index = 0, binding = 2) uniform subpassInput committed_state;
layout(input_attachment_index = 1, binding = 3) uniform subpassInput pending_state;
layout(input_attachment_index = 2, binding = 4) uniform subpassInput extent_state;
layout(location = 0) flat in uint layer;
layout(location = 0) out vec4 committed_out;
layout(location = 1) out vec4 pending_out;
layout(location = 2) out vec2 extent_out;

void main() {
    vec4 c = subpassLoad(committed_state);
    vec4 p = subpassLoad(pending_state);
    vec2 extent = subpassLoad(extent_state).xy;
    Committed committed = Committed(c.rgb, c.a);
    Segment pending = Segment(p.rgb, p.a, extent.x, extent.y);
    merge(pending, committed, segment_of(layer, ivec2(gl_FragCoord.xy)));
    committed_out = vec4(committed.radiance, committed.optical_depth);
    pending_out = vec4(pending.colour, pending.optical_depth);
    extent_out = vec2(pending.t_enter, pending.t_exit);
}
