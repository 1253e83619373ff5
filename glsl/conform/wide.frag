#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_fragment_shader_interlock : require
// vertex: conform/layers.vert
// As conform/order.glsl with a state of 40 bytes in three images, as mode `interlock` has: each word is made of another one,
// so that words of different layers never go together unseen.
#include "conform/layer.glsl"
layout(pixel_interlock_ordered) in;
layout(binding = 1, rgba32ui) coherent uniform uimage2D state_a;
layout(binding = 2, rgba32ui) coherent uniform uimage2D state_b;
layout(binding = 3, rg32ui) coherent uniform uimage2D state_c;
layout(location = 0) flat in uint layer;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    bool lost = is_lost(layer, texel);
    beginInvocationInterlockARB();
    uvec4 a = imageLoad(state_a, texel);
    uvec4 b = imageLoad(state_b, texel);
    uvec2 c = imageLoad(state_c, texel).xy;
    uint old[10] = uint[](a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, c.x, c.y);
    uint new[10];
    for (uint i = 0u; i < 10u; ++i) new[i] = lost ? old[i] : chain(old[(i + 1u) % 10u], layer + i);
    imageStore(state_a, texel, uvec4(new[0], new[1], new[2], new[3]));
    imageStore(state_b, texel, uvec4(new[4], new[5], new[6], new[7]));
    imageStore(state_c, texel, uvec4(new[8], new[9], 0u, 0u));
    endInvocationInterlockARB();
}
