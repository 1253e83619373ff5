#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_fragment_shader_interlock : require
// vertex: blend/particle.vert
// lighting: each
// Mode `interlock:K` with K = WINDOW > 1 pending segments a pixel, in the layers of one storage image: what is committed, then
// colour and optical depth of each segment, then the ends of two segments a layer.
// Cost: 16 + 24 K bytes read and written a fragment inside the critical section, and `insert` between.
#include "blend/bindings.glsl"
layout(pixel_interlock_ordered) in;
layout(constant_id = 2) const uint WINDOW = 2;
// `coherent`: the interlock orders accesses, it does not make them visible.
layout(binding = 9, rgba32f) coherent uniform image2DArray window_state;
#include "blend/segment.glsl"
#include "blend/window.glsl"
layout(location = 0) flat in uint particle_index;

void main() {
    Segment incoming = particle_segment(particle_index, gl_FragCoord.xy);
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    // Begin and end stand once, at the top level of main, in uniform control flow; an empty segment passes through.
    beginInvocationInterlockARB();
    if (incoming.optical_depth > 0.0) {
        vec4 c = imageLoad(window_state, ivec3(pixel, 0));
        Committed committed = Committed(c.rgb, c.a);
        Segment window[WINDOW];
        [[unroll]] for (int i = 0; i < int(WINDOW); i += 2) {
            vec4 first = imageLoad(window_state, ivec3(pixel, 1 + i));
            vec4 second = imageLoad(window_state, ivec3(pixel, 2 + i));
            vec4 ends = imageLoad(window_state, ivec3(pixel, 1 + int(WINDOW) + i / 2));
            window[i] = Segment(first.rgb, first.a, ends.x, ends.y);
            window[i + 1] = Segment(second.rgb, second.a, ends.z, ends.w);
        }
        insert(window, committed, incoming);
        imageStore(window_state, ivec3(pixel, 0), vec4(committed.radiance, committed.optical_depth));
        [[unroll]] for (int i = 0; i < int(WINDOW); i += 2) {
            Segment first = window[i], second = window[i + 1];
            imageStore(window_state, ivec3(pixel, 1 + i), vec4(first.colour, first.optical_depth));
            imageStore(window_state, ivec3(pixel, 2 + i), vec4(second.colour, second.optical_depth));
            vec4 ends = vec4(first.t_enter, first.t_exit, second.t_enter, second.t_exit);
            imageStore(window_state, ivec3(pixel, 1 + int(WINDOW) + i / 2), ends);
        }
    }
    endInvocationInterlockARB();
}
