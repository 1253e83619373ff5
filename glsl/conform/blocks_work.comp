#version 460
// Work that takes a while: each thread walks a long chain of hashes.
#extension GL_GOOGLE_include_directive : require
#include "conform/blocks.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) restrict writeonly buffer WorkResult { uint value[]; } result;
layout(push_constant) uniform BlocksWorkPush { uint rounds; } push;

void main() {
    uint v = gl_GlobalInvocationID.x;
    for (uint i = 0u; i < push.rounds; ++i) v = conform_hash(v);
    result.value[gl_GlobalInvocationID.x] = v;
}
