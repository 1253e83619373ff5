#version 460
#extension GL_GOOGLE_include_directive : require
// vertex: conform/layers.vert
// Copies each sample of an attachment to a buffer, as the last draw of its pass: images of more than one sample cannot be
// copied otherwise.
#include "conform/layer.glsl"
layout(input_attachment_index = 0, binding = 1) uniform usubpassInputMS state;
layout(binding = 2, std430) writeonly restrict buffer Dump { uint words[]; } dump;
layout(location = 0) flat in uint layer;
layout(location = 0) out uint state_out;
layout(constant_id = 4) const uint SAMPLES = 1;

void main() {
    uint word = subpassLoad(state, gl_SampleID).x;
    dump.words[(uint(gl_FragCoord.y) * push.stride + uint(gl_FragCoord.x)) * SAMPLES + uint(gl_SampleID)] = word;
    state_out = word;
}
