#version 460
#extension GL_GOOGLE_include_directive : require
// vertex: blend/particle.vert
// lighting: each
// Mode `attachment`: the merge of `interlock`, with the pixel's state in colour attachments that a fragment reads back as
// input attachments. VK_EXT_rasterization_order_attachment_access orders the fragments of one pixel as they were drawn; that
// is part of the pipeline, not of the shader.
#include "blend/bindings.glsl"
layout(input_attachment_index = 0, binding = 9) uniform subpassInput state_0;    // radiance, Σ optical depth
layout(input_attachment_index = 1, binding = 10) uniform subpassInput state_1;   // colour, optical depth
layout(input_attachment_index = 2, binding = 11) uniform subpassInput state_2;   // t_enter, t_exit
#include "blend/segment.glsl"
layout(location = 0) flat in uint particle_index;
layout(location = 0) out vec4 committed_out;
layout(location = 1) out vec4 pending_out;
layout(location = 2) out vec2 ends_out;

void main() {
    Segment incoming = particle_segment(particle_index, gl_FragCoord.xy);
    if (incoming.optical_depth <= 0.0) discard;
    vec4 c = subpassLoad(state_0);
    vec4 p = subpassLoad(state_1);
    vec2 ends = subpassLoad(state_2).xy;
    Committed committed = Committed(c.rgb, c.a);
    Segment pending = Segment(p.rgb, p.a, ends.x, ends.y);
    merge(pending, committed, incoming);
    committed_out = vec4(committed.radiance, committed.optical_depth);
    pending_out = vec4(pending.colour, pending.optical_depth);
    ends_out = vec2(pending.t_enter, pending.t_exit);
}
