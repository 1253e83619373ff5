// Density inside the reference particle, 0..1, by style (Yusov, Fig. 4): which share of the particle's extinction there is
// at a point of the unit ball. Outside the ball it is 0. CPU twin: src/reference/optical_depth.rs.
#ifndef WELKIN_LUT_PROFILE_GLSL
#define WELKIN_LUT_PROFILE_GLSL

const uint PROFILE_HOMOGENEOUS = 0u;   // 1 everywhere
const uint PROFILE_RADIAL = 1u;        // radial fall-off + noise
const uint PROFILE_THRESHOLD = 2u;     // noise above a threshold that grows outwards
const uint PROFILE_PYROCLASTIC = 3u;   // a ball whose surface is displaced by billows
const uint PROFILE_GAUSSIAN = 4u;      // a Gaussian, lowered to 0 at the rim (Harris 2)
const uint PROFILE_POLYNOMIAL = 5u;    // 2 r³ - 3 r² + 1 (Stoian 6)

// PCG-3D hash (Jarzynski and Olano, "Hash Functions for GPU Rendering", 2020) of a lattice point, three words.
uvec3 profile_hash(ivec3 cell, uint seed) {
    uvec3 v = uvec3(cell) + uvec3(seed * 0x9e3779b9u, seed, ~seed);
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    return v >> 8u;                                          // the upper 24 bits, exact in f32
}

// Smooth value noise, 0..1.
float profile_value_noise(vec3 p, uint seed) {
    vec3 cell = floor(p), f = p - cell;
    f = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    float sum = 0.0;
    for (int k = 0; k < 8; ++k) {
        ivec3 corner = ivec3(k & 1, (k >> 1) & 1, k >> 2);
        vec3 w = mix(1.0 - f, f, vec3(corner));
        sum += w.x * w.y * w.z * float(profile_hash(ivec3(cell) + corner, seed).x);
    }
    return sum * (1.0 / 16777216.0);
}

// Four octaves, 0..1, mean ½.
float profile_fbm(vec3 p, uint seed) {
    float sum = 0.0, amplitude = 0.5333333333;               // 8/15: the four amplitudes add up to 1
    for (uint octave = 0u; octave < 4u; ++octave) {
        sum += amplitude * profile_value_noise(p, seed + octave);
        p *= 2.17;                                           // tuned: not 2, or lattices would coincide
        amplitude *= 0.5;
    }
    return sum;
}

// Round bumps with creases between them: 1 - F1² / reach², a paraboloid on the nearest of the jittered lattice points.
float profile_billow(vec3 p, uint seed) {
    const float REACH_SQUARED = 0.75;                        // F1² seldom exceeds it (tuned)
    ivec3 base = ivec3(floor(p));
    float nearest = 1e9;
    for (int k = 0; k < 27; ++k) {
        ivec3 cell = base + ivec3(k % 3, (k / 3) % 3, k / 9) - 1;
        vec3 d = p - vec3(cell) - vec3(profile_hash(cell, seed)) * (1.0 / 16777216.0);
        nearest = min(nearest, dot(d, d));
    }
    return max(1.0 - nearest / REACH_SQUARED, 0.0);
}

// How far below the unit sphere the pyroclastic surface lies along the direction of p, in radii: lobes of three sizes.
// Depends on direction alone, so the particle is star-shaped and stays compact.
float profile_depth(vec3 direction, uint seed) {
    float relief = 0.50 * (1.0 - profile_billow(direction * 1.6 + 11.3, seed))
                 + 0.31 * (1.0 - profile_billow(direction * 3.7 + 5.1, seed + 1u))
                 + 0.19 * (1.0 - profile_billow(direction * 8.3 + 2.7, seed + 2u));
    return 0.42 * relief;                                    // tuned: amplitude of the relief
}

float profile_density(vec3 p_us, uint style, uint seed) {
    float r2 = dot(p_us, p_us);
    if (r2 > 1.0) return 0.0;
    if (style == PROFILE_HOMOGENEOUS) return 1.0;
    float r = sqrt(r2);
    if (style == PROFILE_GAUSSIAN) return 1.0 - (1.0 - exp(-2.0 * r2)) * 1.15651764;   // 1 / (1 - e^-2)
    if (style == PROFILE_POLYNOMIAL) return 1.0 - r2 * (3.0 - 2.0 * r);
    // Every other style ends softly over the last few hundredths of the radius, or silhouettes would alias in the table.
    float rim = clamp((1.0 - r) * 25.0, 0.0, 1.0);
    if (style == PROFILE_RADIAL) {
        return rim * clamp(1.6 * (1.0 - r2) + 1.4 * (profile_fbm(p_us * 2.3 + 7.7, seed) - 0.5), 0.0, 1.0);
    }
    if (style == PROFILE_THRESHOLD) {
        float threshold = 0.18 + 0.42 * r2;                  // tuned: full inside, islands at the rim
        return rim * clamp(6.0 * (profile_fbm(p_us * 2.6 + 3.1, seed) - threshold), 0.0, 1.0);
    }
    vec3 direction = r > 1e-6 ? p_us / r : vec3(0.0, 1.0, 0.0);
    // The surface is a ramp a few hundredths wide; the core is solid.
    return clamp((1.0 - r - profile_depth(direction, seed)) * 22.0, 0.0, 1.0);
}

#endif
