#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_fragment_shader_interlock : require
// vertex: blend/particle.vert
// lighting: each
// Mode `interlock`: the pixel's pending segment lives in storage images; VK_EXT_fragment_shader_interlock makes the
// read-modify-write of one pixel atomic, and orders it as the particles were drawn, back to front.
// Cost: 40 bytes read and up to 40 written a fragment; everything computable is computed before the critical section.
#include "blend/bindings.glsl"
layout(pixel_interlock_ordered) in;
// `coherent`: the interlock orders accesses, it does not make them visible.
layout(binding = 9, rgba32f) coherent uniform image2D interlocked_committed;   // radiance, Σ optical depth
layout(binding = 10, rgba32f) coherent uniform image2D interlocked_pending;    // colour, optical depth
layout(binding = 11, rg32f) coherent uniform image2D interlocked_extent;       // t_enter, t_exit
#include "blend/segment.glsl"
layout(location = 0) flat in uint particle_index;

void main() {
    Segment incoming = particle_segment(particle_index, gl_FragCoord.xy);
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    // Begin and end stand once, at the top level of main, in uniform control flow; an empty segment passes through.
    beginInvocationInterlockARB();
    if (incoming.optical_depth > 0.0) {
        vec4 c = imageLoad(interlocked_committed, pixel);
        vec4 p = imageLoad(interlocked_pending, pixel);
        vec2 extent = imageLoad(interlocked_extent, pixel).xy;
        Committed committed = Committed(c.rgb, c.a);
        Segment pending = Segment(p.rgb, p.a, extent.x, extent.y);
        merge(pending, committed, incoming);
        imageStore(interlocked_committed, pixel, vec4(committed.radiance, committed.optical_depth));
        imageStore(interlocked_pending, pixel, vec4(pending.colour, pending.optical_depth));
        imageStore(interlocked_extent, pixel, vec4(pending.t_enter, pending.t_exit, 0.0, 0.0));
    }
    endInvocationInterlockARB();
}
