// Integer hashes. Every random decision in the particle source comes from here, so that the CPU reference
// (src/reference/density.rs) repeats it bit for bit on any device.
#ifndef WELKIN_DENSITY_HASH
#define WELKIN_DENSITY_HASH

// PCG-RXS-M-XS, 32 bits (O'Neill 2014, as a hash: Jarzynski and Olano 2020).
uint pcg(uint v) {
    uint state = v * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

uint hash_lattice(ivec2 point, uint seed) {
    return pcg(uint(point.x) + pcg(uint(point.y) + pcg(seed)));
}

// Uniform in [0, 1), a multiple of 2^-24: exact in f32.
float unit_float(uint hash) {
    return float(hash >> 8u) * 5.9604644775390625e-8;
}

// Uniform in [-1, 1), exact in f32.
float signed_float(uint hash) {
    return float(hash >> 8u) * 1.1920928955078125e-7 - 1.0;
}

#endif
