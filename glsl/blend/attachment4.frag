#version 460
#extension GL_GOOGLE_include_directive : require
// vertex: blend/particle.vert
// lighting: each
// Mode `attachment:4`: the window of `interlock:4` in seven colour attachments of 16 bytes; see attachment.frag.
#include "blend/bindings.glsl"
layout(input_attachment_index = 0, binding = 9) uniform subpassInput state_0;    // radiance, Σ optical depth
layout(input_attachment_index = 1, binding = 10) uniform subpassInput state_1;   // colour, optical depth
layout(input_attachment_index = 2, binding = 11) uniform subpassInput state_2;
layout(input_attachment_index = 3, binding = 13) uniform subpassInput state_3;
layout(input_attachment_index = 4, binding = 14) uniform subpassInput state_4;
layout(input_attachment_index = 5, binding = 15) uniform subpassInput state_5;   // t_enter, t_exit of segments 0 and 1
layout(input_attachment_index = 6, binding = 16) uniform subpassInput state_6;   // of segments 2 and 3
#include "blend/segment.glsl"
#define WINDOW 4u
#include "blend/window.glsl"
layout(location = 0) flat in uint particle_index;
layout(location = 0) out vec4 committed_out;
layout(location = 1) out vec4 segment_0_out;
layout(location = 2) out vec4 segment_1_out;
layout(location = 3) out vec4 segment_2_out;
layout(location = 4) out vec4 segment_3_out;
layout(location = 5) out vec4 ends_01_out;
layout(location = 6) out vec4 ends_23_out;

void main() {
    Segment incoming = particle_segment(particle_index, gl_FragCoord.xy);
    if (incoming.optical_depth <= 0.0) discard;
    vec4 c = subpassLoad(state_0), e01 = subpassLoad(state_5), e23 = subpassLoad(state_6);
    vec4 s0 = subpassLoad(state_1), s1 = subpassLoad(state_2), s2 = subpassLoad(state_3), s3 = subpassLoad(state_4);
    Committed committed = Committed(c.rgb, c.a);
    Segment window[WINDOW];
    window[0] = Segment(s0.rgb, s0.a, e01.x, e01.y);
    window[1] = Segment(s1.rgb, s1.a, e01.z, e01.w);
    window[2] = Segment(s2.rgb, s2.a, e23.x, e23.y);
    window[3] = Segment(s3.rgb, s3.a, e23.z, e23.w);
    insert(window, committed, incoming);
    committed_out = vec4(committed.radiance, committed.optical_depth);
    segment_0_out = vec4(window[0].colour, window[0].optical_depth);
    segment_1_out = vec4(window[1].colour, window[1].optical_depth);
    segment_2_out = vec4(window[2].colour, window[2].optical_depth);
    segment_3_out = vec4(window[3].colour, window[3].optical_depth);
    ends_01_out = vec4(window[0].t_enter, window[0].t_exit, window[1].t_enter, window[1].t_exit);
    ends_23_out = vec4(window[2].t_enter, window[2].t_exit, window[3].t_enter, window[3].t_exit);
}
