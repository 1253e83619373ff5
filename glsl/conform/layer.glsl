// What the ordering checks draw, and the merges that tell in which order it came.
#ifndef CONFORM_LAYER
#define CONFORM_LAYER

struct ConformLayer {
    vec4 bounds;    // rectangle in clip space: x, y of one corner and of the opposite one
    float depth;    // 0 to 1
    uint index;     // place in the order
    uint reserved_a;
    uint reserved_b;
};

layout(push_constant) uniform Push {
    uint first;          // rectangle that the draw begins with
    uint per_instance;   // rectangles in an instance
    uint stride;         // width of the state [texels]
    uint lost;           // whether one fragment forgets to write, for tests
} push;

layout(constant_id = 0) const uint MERGE = 0;      // one of the merges below
const uint MERGE_SET = 0;           // a bit for each layer (and sample): every one came, in any order
const uint MERGE_SET_IN_ORDER = 1;  // the same, and every layer finds all before it; else it clears
const uint MERGE_CHAIN = 2;         // a number that no other order gives
const uint MERGE_SUM = 3;           // one that every order gives, for tests

// One step of the chain: multiplication and addition do not commute.
uint chain(uint state, uint layer) {
    uint term = (layer + 1u) * 2654435761u;
    return MERGE == MERGE_SUM ? state + term : state * 1664525u + (term ^ (term >> 15));
}

// The same in whole numbers below 2048, which every float format holds exactly.
uint short_chain(uint state, uint layer) {
    uint term = ((layer + 1u) * 2654435761u) >> 21;
    return (MERGE == MERGE_SUM ? state + term : state * 613u + term) & 2047u;
}

// Whether this is the fragment that is lost on purpose.
bool is_lost(uint layer, ivec2 texel) { return push.lost != 0u && layer == 1u && texel == ivec2(2, 0); }

#endif
