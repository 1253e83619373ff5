// The bare planet: fields, woods and meadows of low contrast, and the light they send back.
#ifndef ATMOSPHERE_GROUND_GLSL
#define ATMOSPHERE_GROUND_GLSL

#include "atmosphere/air.glsl"

// Positions are taken modulo this [m], so that f32 keeps centimetres anywhere on the planet; every lattice below
// divides it, so the pattern goes on without a seam.
const float GROUND_PERIOD = 131072.0;

// Position on the ground, wrapped, from one relative to the floating origin (whose multiples of 1024 m are exact).
vec2 ground_position(vec3 origin, vec2 p_ws) { return mod(mod(origin.xz, GROUND_PERIOD) + p_ws, GROUND_PERIOD); }

// Four well-mixed bytes' worth of a lattice cell, each in [0, 1) (pcg3d of Jarzynski and Olano 2020, its last round).
vec4 ground_hash(ivec2 cell, uint salt) {
    uvec3 v = uvec3(uvec2(cell), salt) * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return vec4(vec3(v >> 8u) / 16777216.0, float((v.x ^ (v.z << 3u)) >> 8u) / 16777216.0);
}

// Smooth noise in [0, 1] on a lattice of `cell` metres, which divides the period.
float ground_noise(vec2 p, float cell, uint salt) {
    vec2 q = p / cell;
    ivec2 i = ivec2(floor(q)), n = ivec2(int(GROUND_PERIOD / cell));
    vec2 f = q - floor(q);
    f = f * f * (3.0 - 2.0 * f);
    ivec2 j = (i + 1) % n;
    i %= n;
    float a = ground_hash(i, salt).x, b = ground_hash(ivec2(j.x, i.y), salt).x;
    float c = ground_hash(ivec2(i.x, j.y), salt).x, d = ground_hash(j, salt).x;
    return mix(mix(a, b, f.x), mix(c, d, f.x), f.y);
}

// How much of a pattern with features of `size` metres is left under a pixel of `footprint` metres.
float resolved(float size, float footprint) { return 1.0 - smoothstep(0.25, 1.0, footprint / size); }

// Sum of octaves from `cell` metres downwards, each faded to its mean before it aliases; in [0, 1], mean 1/2.
float ground_fbm(vec2 p, float cell, int octaves, float footprint, uint salt) {
    float sum = 0.0, amplitude = 0.5;
    for (int i = 0; i < octaves; ++i) {
        float keep = resolved(cell, footprint);
        if (keep <= 0.0) break;
        sum += amplitude * keep * (ground_noise(p, cell, salt + uint(i)) - 0.5);
        amplitude *= 0.5;
        cell *= 0.5;
    }
    return 0.5 + sum;
}

const float FIELD_SIZE = 512.0; // [m], tuned

// A patchwork of fields: the cells of jittered points. Returns a random number for the nearest point's field in x, one
// for its kind in y, and in z the distance to the border with the next [m].
vec3 field_at(vec2 p) {
    vec2 q = p / FIELD_SIZE;
    ivec2 base = ivec2(floor(q)), n = ivec2(int(GROUND_PERIOD / FIELD_SIZE));
    float nearest = 1e9, second = 1e9;
    vec4 owner = vec4(0.0);
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            ivec2 cell = base + ivec2(x, y);
            vec4 random = ground_hash((cell + n) % n, 77u);
            vec2 d = vec2(cell) + 0.15 + 0.7 * random.xy - q;
            float distance = max(abs(d.x) * 1.25, abs(d.y)); // straight hedges rather than foam
            if (distance < nearest) {
                second = nearest;
                nearest = distance;
                owner = random;
            } else {
                second = min(second, distance);
            }
        }
    }
    return vec3(owner.z, owner.w, (second - nearest) * 0.5 * FIELD_SIZE);
}

// Diffuse albedo of the ground at wrapped position p [m], averaged over about `footprint` metres; its mean over the
// planet is about `mean_albedo`. Relative colours of crop, meadow, fallow and wood are tuned on photographs from the air.
vec3 ground_albedo(vec3 mean_albedo, vec2 p, float footprint) {
    const vec3 wood = vec3(0.42, 0.52, 0.48);
    const vec3 field_mean = vec3(1.19, 1.14, 1.10);
    float land = ground_fbm(p, 16384.0, 4, footprint, 11u); // where woods are
    vec3 relative = field_mean;
    float keep = resolved(0.7 * FIELD_SIZE, footprint);
    if (keep > 0.0) {
        vec2 warp = vec2(ground_noise(p, 2048.0, 5u), ground_noise(p, 2048.0, 6u)) * 500.0; // lanes wind a little
        vec3 field = field_at(mod(p + warp, GROUND_PERIOD));
        vec3 crop = mix(vec3(0.82, 0.92, 0.78), vec3(1.18, 1.22, 1.02), field.x);      // green crop and meadow
        vec3 straw = mix(vec3(1.75, 1.45, 1.50), vec3(1.35, 1.08, 1.35), field.x);     // ripe grain and bare soil
        vec3 colour = mix(crop, straw, smoothstep(0.55, 0.75, field.y));
        colour *= 0.4 + 1.2 * ground_fbm(p, 128.0, 4, footprint, 31u); // unevenness
        float hedge = resolved(24.0, footprint);
        if (hedge > 0.0 && field.z < 20.0) {
            float ragged = 8.0 * ground_fbm(p, 32.0, 2, footprint, 51u);
            hedge *= 1.0 - smoothstep(2.0, 9.0, field.z - ragged + 4.0);
            colour = mix(colour, wood * (0.6 + 0.8 * ground_fbm(p, 16.0, 3, footprint, 61u)), 0.85 * hedge);
        }
        relative = mix(relative, colour, keep);
    }
    float wooded = smoothstep(0.53, 0.53 + mix(0.015, 0.10, smoothstep(20.0, 2000.0, footprint)), land);
    if (wooded > 0.0) {
        float crowns = 0.8 + 0.4 * ground_fbm(p, 128.0, 3, footprint, 41u);
        relative = mix(relative, wood * crowns, wooded);
    }
    return mean_albedo * relative * (0.85 + 0.3 * ground_fbm(p, 32768.0, 1, footprint, 21u));
}

// Radiance of diffuse ground under sun and sky [irradiance/sr].
vec3 ground_radiance(vec3 albedo, vec3 sun_irradiance, float mu_s, float cloud_shadow, vec3 sky_irradiance) {
    return albedo / AIR_PI * (sun_irradiance * (max(mu_s, 0.0) * cloud_shadow) + sky_irradiance);
}

#endif
