#version 460
#extension GL_GOOGLE_include_directive : require
// vertex: conform/layers.vert
// As attach_uint.frag with four attachments of float formats, all read and written by every fragment: whole numbers below
// 2048, which each format holds exactly, a chain of its own in each component.
#include "conform/layer.glsl"
layout(input_attachment_index = 0, binding = 1) uniform subpassInput state_a;
layout(input_attachment_index = 1, binding = 2) uniform subpassInput state_b;
layout(input_attachment_index = 2, binding = 3) uniform subpassInput state_c;
layout(input_attachment_index = 3, binding = 4) uniform subpassInput state_d;
layout(location = 0) flat in uint layer;
layout(location = 0) out vec4 out_a;
layout(location = 1) out vec4 out_b;
layout(location = 2) out vec2 out_c;
layout(location = 3) out float out_d;

float next(float old, uint component) {
    return is_lost(layer, ivec2(gl_FragCoord.xy)) ? old : float(short_chain(uint(old), layer + component));
}

void main() {
    vec4 a = subpassLoad(state_a);
    vec4 b = subpassLoad(state_b);
    vec2 c = subpassLoad(state_c).xy;
    float d = subpassLoad(state_d).x;
    out_a = vec4(next(a.x, 0u), next(a.y, 1u), next(a.z, 2u), next(a.w, 3u));
    out_b = vec4(next(b.x, 4u), next(b.y, 5u), next(b.z, 6u), next(b.w, 7u));
    out_c = vec2(next(c.x, 8u), next(c.y, 9u));
    out_d = next(d, 10u);
}
