// Billow noise: rounded bumps with sharp creases between them, the surface texture of cumulus.
// Inverted cellular noise: 1 - F1² / r², a paraboloid over each jittered lattice point; periodic, so that it tiles.
#ifndef DETAIL_BILLOW
#define DETAIL_BILLOW

const int   BILLOW_CELLS = 8;      // lattice cells along the edge of the tile
const float BILLOW_REACH = 0.75;   // F1² at which the value reaches 0 [cells²] (largest F1² met is about 0.9; tuned)

// PCG-3D hash (Jarzynski and Olano, "Hash Functions for GPU Rendering", 2020): three decorrelated words.
uvec3 pcg3d(uvec3 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    return v;
}

// xyz: gradient [1/cell], w: value in [0, 1], 1 at the top of a bump. p in cells; the tile is BILLOW_CELLS wide.
vec4 billow(vec3 p) {
    ivec3 base = ivec3(floor(p));
    float nearest = 1e9;
    vec3  offset = vec3(0.0);
    for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x) {
        ivec3 cell = base + ivec3(x, y, z);
        uvec3 wrapped = uvec3((cell + 16 * BILLOW_CELLS) % BILLOW_CELLS);
        // The upper 24 bits are exact in f32.
        vec3 jitter = vec3(pcg3d(wrapped) >> 8u) * (1.0 / 16777216.0);
        vec3 d = p - (vec3(cell) + jitter);
        float d2 = dot(d, d);
        if (d2 < nearest) { nearest = d2; offset = d; }
    }
    float value = 1.0 - nearest / BILLOW_REACH;
    return value > 0.0 ? vec4(-2.0 * offset / BILLOW_REACH, value) : vec4(0.0);
}

#endif
