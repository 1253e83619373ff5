#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_fragment_shader_interlock : require
// vertex: conform/layers.vert
// Welkin's own merge (blend/merge.glsl) in the images that mode `interlock` has.
#include "conform/segments.glsl"
layout(pixel_interlock_ordered) in;
layout(binding = 2, rgba32f) coherent uniform image2D committed_state;
layout(binding = 3, rgba32f) coherent uniform image2D pending_state;
layout(binding = 4, rg32f) coherent uniform image2D extent_state;
layout(location = 0) flat in uint layer;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    Segment incoming = segment_of(layer, texel);
    beginInvocationInterlockARB();
    vec4 c = imageLoad(committed_state, texel);
    vec4 p = imageLoad(pending_state, texel);
    vec2 extent = imageLoad(extent_state, texel).xy;
    Committed committed = Committed(c.rgb, c.a);
    Segment pending = Segment(p.rgb, p.a, extent.x, extent.y);
    merge(pending, committed, incoming);
    imageStore(committed_state, texel, vec4(committed.radiance, committed.optical_depth));
    imageStore(pending_state, texel, vec4(pending.colour, pending.optical_depth));
    imageStore(extent_state, texel, vec4(pending.t_enter, pending.t_exit, 0.0, 0.0));
    endInvocationInterlockARB();
}
