#version 460
#extension GL_GOOGLE_include_directive : require
// Mode `tiled`: how many particles, pairs, tiles, and unfinished half tiles there are, as indirect arguments. One thread.
#include "blend/tiled_use.glsl"
#include "compact/groups.glsl"
#include "grid/counters.glsl"
layout(local_size_x = 1) in;
layout(binding = 0, std430) restrict readonly buffer DrawArgs { uint word[]; } draw_args;
layout(binding = 1, std430) restrict readonly buffer PairTotal { uint total; } pair_total;
layout(binding = 2, std430) restrict buffer TiledUseBuffer { TiledUse value; } tiled_use;
layout(binding = 3, std430) restrict buffer CountersBuffer { Counters count; } counters;
layout(push_constant) uniform TiledArgsPush { uint stage; uint instances; uint capacity; } push;

void main() {
    if (push.stage == 0u) {
        uint visible = draw_args.word[push.instances];
        counters.count.visible = visible;
        uint particles = min(visible, push.capacity);
        tiled_use.value.particles = particles;
        tiled_use.value.particle_groups = groups_for(particles, 64u);
        tiled_use.value.particle_sort = groups_for(particles, 1024u);
        tiled_use.value.tiles = 0u;
        tiled_use.value.rest = 0u;
    } else if (push.stage == 1u) {
        counters.count.blend_nodes = max(counters.count.blend_nodes, pair_total.total);
        uint pairs = min(pair_total.total, push.capacity);
        tiled_use.value.pairs = pairs;
        tiled_use.value.pair_groups = groups_for(pairs, 64u);
        tiled_use.value.pair_sort = groups_for(pairs, 1024u);
    } else if (push.stage == 2u) {
        tiled_use.value.tile_groups = groups_for(tiled_use.value.tiles, 1u);
    } else {
        tiled_use.value.rest_groups = groups_for(tiled_use.value.rest, 1u);
    }
}
