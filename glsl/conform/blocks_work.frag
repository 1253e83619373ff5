#version 460
// vertex: conform/blocks_work.vert
// The work of blocks_work.comp for each pixel.
#extension GL_GOOGLE_include_directive : require
#include "conform/blocks.glsl"
layout(location = 0) out vec4 colour;
layout(push_constant) uniform BlocksWorkPush { uint rounds; } push;

void main() {
    uint v = uint(gl_FragCoord.x) + 4096u * uint(gl_FragCoord.y);
    for (uint i = 0u; i < push.rounds; ++i) v = conform_hash(v);
    colour = vec4(float(v & 255u));
}
