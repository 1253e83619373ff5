#version 460
#extension GL_GOOGLE_include_directive : require
// vertex: conform/layers.vert
// As attach_uint.frag, for each sample.
#include "conform/layer.glsl"
layout(input_attachment_index = 0, binding = 1) uniform usubpassInputMS state;
layout(location = 0) flat in uint layer;
layout(location = 0) out uint state_out;

void main() {
    uint old = subpassLoad(state, gl_SampleID).x;
    state_out = is_lost(layer, ivec2(gl_FragCoord.xy)) ? old : chain(old, layer);
}
