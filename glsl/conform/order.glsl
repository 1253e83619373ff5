// Ordering by interlock: every fragment reads, changes and writes one 32-bit word of its pixel or sample. The interlock
// mode of the module is changed after compilation (src/conform/variant.rs): pixel or sample, ordered or not.
#include "conform/layer.glsl"
layout(pixel_interlock_ordered) in;
// `coherent`: the interlock orders accesses, it does not make them visible.
layout(binding = 1, r32ui) coherent uniform uimage2D state_image;
layout(binding = 2, std430) coherent restrict buffer State { uint words[]; } state_buffer;
layout(location = 0) flat in uint layer;
layout(constant_id = 1) const uint IN_BUFFER = 0;   // where the state is
layout(constant_id = 2) const uint DISCARD = 0;     // every other column goes, before or within the critical section
layout(constant_id = 3) const uint BITS = 1;        // bits of the state that a layer has to itself

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
#ifdef PER_SAMPLE
    texel.x = texel.x * int(SAMPLES) + gl_SampleID;   // samples side by side
    uint mask = 1u << (layer & 31u);
#else
    uint mask = uint(gl_SampleMaskIn[0]) << (layer * BITS & 31u);
#endif
    uint before = (1u << (layer * BITS & 31u)) - 1u;
    bool odd = (texel.x & 1) != 0;
    if (DISCARD != 0u && odd && texel.y < 3) discard;
    beginInvocationInterlockARB();
    if (DISCARD != 0u && odd) discard;
    uint place = uint(texel.y) * push.stride + uint(texel.x);
    uint old = IN_BUFFER != 0u ? state_buffer.words[place] : imageLoad(state_image, texel).x;
    uint new = MERGE == MERGE_SET ? old | mask
             : MERGE == MERGE_SET_IN_ORDER ? ((old & before) == before ? old | mask : 0u)
             : chain(old, layer);
    if (is_lost(layer, texel)) new = old;
    if (IN_BUFFER != 0u) state_buffer.words[place] = new;
    else imageStore(state_image, texel, uvec4(new, 0u, 0u, 0u));
    endInvocationInterlockARB();
}
