// What a test breaks on purpose in the shaders of the `blocks` rows, so that each row is seen to fail.
#ifndef CONFORM_BLOCKS
#define CONFORM_BLOCKS

layout(constant_id = 0) const uint SABOTAGE = 0u;
const uint BROKEN_LOST = 1u;        // one thing is left out
const uint BROKEN_UNORDERED = 2u;   // an atomic operation is a read and a write
const uint BROKEN_REVERSED = 3u;    // a direction or a comparison is the wrong way round

uint conform_hash(uint v) {         // PCG-RXS-M-XS, as in density/hash.glsl
    uint state = v * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

#endif
