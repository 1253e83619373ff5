// Where clouds are: a world-anchored 2D field, sampled at cell centres.
//
// Positions are integers in steps of 1/64 of half a ring-0 cell, counted from the world's origin, so that 10^7 m from
// it nothing is lost and nothing depends on the camera. A noise of wavelength λ has a frequency in 2^-32 lattice cells
// per step; the 64-bit product splits into lattice cell and fraction without rounding.
//
// Only +, -, × and integer operations, all `precise` (no contraction): Vulkan rounds those correctly, hence the CPU
// reference takes the same decisions bit for bit.
#ifndef WELKIN_DENSITY_FIELD
#define WELKIN_DENSITY_FIELD
#include "density/hash.glsl"

struct LatticePoint {
    ivec2 cell;
    vec2 fraction;
};

LatticePoint lattice_point(ivec2 position, int frequency) {
    int x_high, z_high, x_low, z_low;
    imulExtended(position.x, frequency, x_high, x_low);
    imulExtended(position.y, frequency, z_high, z_low);
    return LatticePoint(ivec2(x_high, z_high), vec2(unit_float(uint(x_low)), unit_float(uint(z_low))));
}

// A random number that moves with time: `start`, 31 bits, walks to and fro over its range at a pace of its own, so that an
// even distribution stays one at any time. 24 bits; at phase 0 the upper ones of `start`. A life, 2^24 of the phase, takes
// it once through its range at the mean pace; after 256 lives it is back. Integers wrap, so nothing is ever lost.
uint walk(uint start, uint pace, uint phase) {
    uint way = phase * (64u + (pace & 127u));
    uint at = start + ((pace & 128u) == 0u ? way : 0u - way);
    return (at >= 0x80000000u ? ~at : at) >> 7u;
}

// A coordinate in 2^-32 lattice cells.
struct LatticeSum {
    uint low;
    int high;
};

// sum + position × frequency.
LatticeSum lattice_sum(LatticeSum sum, int position, int frequency) {
    int high, low;
    imulExtended(position, frequency, high, low);
    uint carry;
    sum.low = uaddCarry(sum.low, uint(low), carry);
    sum.high += high + int(carry);
    return sum;
}

// The point of a lattice that is turned: its axes point along (along, across) and (-across, along), in 2^-32 lattice cells
// per step, and the position 0 lies `half_cells` half cells from its first point. Exact, as `lattice_point`.
LatticePoint turned_lattice_point(ivec2 position, int along, int across, ivec2 half_cells) {
    ivec2 cell;
    vec2 fraction;
    for (int axis = 0; axis < 2; ++axis) {
        LatticeSum sum = LatticeSum(uint(half_cells[axis] & 1) << 31, half_cells[axis] >> 1);
        sum = lattice_sum(sum, position.x, axis == 0 ? along : -across);
        sum = lattice_sum(sum, position.y, axis == 0 ? across : along);
        cell[axis] = sum.high;
        fraction[axis] = unit_float(sum.low);
    }
    return LatticePoint(cell, fraction);
}

// Quintic fade 6f⁵ - 15f⁴ + 10f³ (Perlin 2002).
float quintic(float f) {
    precise float cube = (f * f) * f;
    precise float slope = f * 6.0 - 15.0;
    precise float factor = f * slope + 10.0;
    precise float result = cube * factor;
    return result;
}

float lattice_gradient(ivec2 corner, float x, float z, uint seed, uint phase) {
    uint hash = hash_lattice(corner, seed);
    uint pace = pcg(hash);
    precise float gx = float(walk((hash & 0xffffu) << 15u, pace, phase)) * 1.1920928955078125e-7 - 1.0;
    precise float gz = float(walk(hash >> 16u << 15u, pace >> 8u, phase)) * 1.1920928955078125e-7 - 1.0;
    precise float along_x = gx * x;
    precise float along_z = gz * z;
    precise float result = along_x + along_z;
    return result;
}

// Gradient noise, zero mean, mostly within ±0.6.
float gradient_noise(LatticePoint p, uint seed, uint phase) {
    precise float x = p.fraction.x, z = p.fraction.y;
    precise float x1 = x - 1.0, z1 = z - 1.0;
    precise float a = lattice_gradient(p.cell, x, z, seed, phase);
    precise float b = lattice_gradient(p.cell + ivec2(1, 0), x1, z, seed, phase);
    precise float c = lattice_gradient(p.cell + ivec2(0, 1), x, z1, seed, phase);
    precise float d = lattice_gradient(p.cell + ivec2(1, 1), x1, z1, seed, phase);
    precise float u = quintic(x), v = quintic(z);
    precise float ab_step = u * (b - a);
    precise float cd_step = u * (d - c);
    precise float ab = a + ab_step;
    precise float cd = c + cd_step;
    precise float v_step = v * (cd - ab);
    precise float result = ab + v_step;
    return result;
}

// One round heap per lattice cell, of random place, width and height: A (1 - d²/r²), the highest of the nine nearest,
// at least 0. Wide heaps are also the high ones. r ≤ 1.09 lattice cells, so nine cells are enough.
float heaps(LatticePoint p, uint seed, uint phase) {
    float highest = 0.0;
    for (int dz = -1; dz <= 1; ++dz) {
        for (int dx = -1; dx <= 1; ++dx) {
            uint hash = hash_lattice(p.cell + ivec2(dx, dz), seed);
            uint shape = pcg(hash);
            uint pace = pcg(shape);
            precise float place_x = float(walk((hash & 0xffffu) << 15u, pace, phase)) * 4.172325134277343e-8 + 0.15;
            precise float place_z = float(walk(hash >> 16u << 15u, pace >> 8u, phase)) * 4.172325134277343e-8 + 0.15;
            precise float x = (float(dx) - p.fraction.x) + place_x;
            precise float z = (float(dz) - p.fraction.y) + place_z;
            precise float narrow = float(walk(shape >> 8u << 7u, pace >> 16u, phase)) * 5.9604644775390625e-8;
            precise float narrow_term = (narrow * narrow) * 2.6;
            precise float inverse_r2 = narrow_term + 0.85;
            precise float low_term = narrow * 0.55;
            precise float height = 1.0 - low_term;
            precise float xx = x * x;
            precise float zz = z * z;
            precise float d2 = xx + zz;
            precise float fall = d2 * inverse_r2;
            precise float bump = height * (1.0 - fall);
            highest = max(highest, bump);
        }
    }
    return highest;
}

// Wavelengths of the field, in 2^-32 lattice cells per position step: see `FieldFrequencies` in src/density.
struct FieldFrequencies {
    int heap;     // heaps, 2.6 km
    int billow;   // outline, 1.3 km; its octaves double the frequency
    int turret;   // turrets on a heap, 0.9 km
    int streak;   // clusters of heaps, 20 km
    int region;   // weather, 200 km
    uint phase;   // of what grows and dissolves, 2^-24 lives; see walk()
    uint weather_phase; // of streaks and weather, which are slower
};

// Positive far inside a cloud, lowest in clear sky; compared with a threshold that gives the wanted coverage.
// `resolved`: share of fine detail that the caller's cells can show; 1 is the field itself.
float coverage_field(ivec2 position, FieldFrequencies f, uint seed, float resolved) {
    precise float heap = heaps(lattice_point(position, f.heap), seed, f.phase) * 1.35;
    precise float n1 = gradient_noise(lattice_point(position, f.billow), seed + 1u, f.phase) * 0.5;
    precise float n2 = gradient_noise(lattice_point(position, f.billow * 2), seed + 2u, f.phase * 2u) * 0.28 * resolved;
    precise float n3 = gradient_noise(lattice_point(position, f.billow * 4), seed + 3u, f.phase * 4u) * 0.15 * resolved * resolved;
    // Yusov's reference values: noise at 1/20 km and at 1/200 km, multiplied, gather the heaps into fields and streaks.
    precise float streak = gradient_noise(lattice_point(position, f.streak), seed + 4u, f.weather_phase) + 0.75;
    precise float region = gradient_noise(lattice_point(position, f.region), seed + 5u, f.weather_phase) + 1.0;
    precise float weather = (streak * region) * 0.55;
    precise float outline = (n1 + n2) + n3;
    precise float sum = heap + outline;
    precise float result = sum + weather;
    return result;
}

// Height of the turrets that stand on a heap, 0 to 1.
float turret_field(ivec2 position, FieldFrequencies f, uint seed) {
    return heaps(lattice_point(position, f.turret), seed + 6u, f.phase);
}

#endif
