#version 460
#extension GL_GOOGLE_include_directive : require
// vertex: blend/particle.vert
// lighting: each
// Mode `attachment:2`: the window of `interlock:2` in four colour attachments of 16 bytes; see attachment.frag.
#include "blend/bindings.glsl"
layout(input_attachment_index = 0, binding = 9) uniform subpassInput state_0;    // radiance, Σ optical depth
layout(input_attachment_index = 1, binding = 10) uniform subpassInput state_1;   // colour, optical depth
layout(input_attachment_index = 2, binding = 11) uniform subpassInput state_2;
layout(input_attachment_index = 3, binding = 13) uniform subpassInput state_3;   // t_enter, t_exit of both segments
#include "blend/segment.glsl"
#define WINDOW 2u
#include "blend/window.glsl"
layout(location = 0) flat in uint particle_index;
layout(location = 0) out vec4 committed_out;
layout(location = 1) out vec4 first_out;
layout(location = 2) out vec4 second_out;
layout(location = 3) out vec4 ends_out;

void main() {
    Segment incoming = particle_segment(particle_index, gl_FragCoord.xy);
    if (incoming.optical_depth <= 0.0) discard;
    vec4 c = subpassLoad(state_0), s0 = subpassLoad(state_1), s1 = subpassLoad(state_2), ends = subpassLoad(state_3);
    Committed committed = Committed(c.rgb, c.a);
    Segment window[WINDOW];
    window[0] = Segment(s0.rgb, s0.a, ends.x, ends.y);
    window[1] = Segment(s1.rgb, s1.a, ends.z, ends.w);
    insert(window, committed, incoming);
    committed_out = vec4(committed.radiance, committed.optical_depth);
    first_out = vec4(window[0].colour, window[0].optical_depth);
    second_out = vec4(window[1].colour, window[1].optical_depth);
    ends_out = vec4(window[0].t_enter, window[0].t_exit, window[1].t_enter, window[1].t_exit);
}
