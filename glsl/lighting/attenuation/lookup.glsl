// Optical depth between points and the sun, out of the volume. CPU twin: src/reference/attenuation.rs.
#ifndef WELKIN_ATTENUATION_LOOKUP
#define WELKIN_ATTENUATION_LOOKUP
#include "lighting/attenuation/shadow.glsl"

const float ATTENUATION_RIM = 1.0;     // voxels at the border of a level that are not looked at
const float ATTENUATION_BLEND = 4.0;   // voxels next to these, over which a level passes into the next coarser one

float volume_depth(sampler3D volume, vec3 place, uint level, in AttenuationParams a) {
    float depth = float(a.depth), layers = depth * float(a.levels);
    float w = float(level) * depth + clamp(place.z, 0.5, depth - 0.5);
    return textureLod(volume, vec3(place.xy / float(a.dim), w / layers), 0.0).x;
}

// The finest level that holds a point, and how much of it counts against the next coarser one.
uint attenuation_level(vec3 p_ws, in AttenuationParams a, out float share) {
    uint level = 0u;
    float room = 0.0;
    for (; level < a.levels; ++level) {
        vec2 place = attenuation_place(p_ws, level, a).xy;
        room = min(min(place.x, place.y), float(a.dim) - max(place.x, place.y)) - ATTENUATION_RIM;
        if (room > 0.0 || level + 1u == a.levels) break;
    }
    share = level + 1u == a.levels ? 1.0 : clamp(room / ATTENUATION_BLEND, 0.0, 1.0);
    return level;
}

// Of all particles.
float sun_depth(sampler3D volume, vec3 p_ws, in AttenuationParams a) {
    float share;
    uint level = attenuation_level(p_ws, a, share);
    float tau = volume_depth(volume, attenuation_place(p_ws, level, a), level, a);
    if (share < 1.0) {
        tau = mix(volume_depth(volume, attenuation_place(p_ws, level + 1u, a), level + 1u, a), tau, share);
    }
    return tau;
}

// Of all but one.
float others_depth(sampler3D volume, vec3 p_ws, Particle p, in AttenuationParams a) {
    float share;
    uint level = attenuation_level(p_ws, a, share);
    vec3 place = attenuation_place(p_ws, level, a);
    float tau = max(volume_depth(volume, place, level, a) - shadow_depth(particle_shadow(p, level, a), place), 0.0);
    if (share < 1.0) {
        place = attenuation_place(p_ws, ++level, a);
        float coarse = volume_depth(volume, place, level, a) - shadow_depth(particle_shadow(p, level, a), place);
        tau = mix(max(coarse, 0.0), tau, share);
    }
    return tau;
}

// Of all particles on the sun's ray through a point, in front of it and behind.
float column_depth(sampler3D volume, vec3 p_ws, in AttenuationParams a) {
    float share;
    uint level = attenuation_level(p_ws, a, share);
    vec3 place = attenuation_place(p_ws, level, a);
    return volume_depth(volume, vec3(place.xy, float(a.depth)), level, a);
}

// Where light is looked up along a segment, in optical depths from where the eye enters it: little is seen behind four.
const float SEEN_DEPTH = 4.0;
const vec4 SEEN_AT = vec4(0.0, 0.125, 0.375, 1.0);

// Mean over a segment of exp(-τ), as the eye sees it through the segment: ∫ exp(-τ(s) - s) ds / ∫ exp(-s) ds, where τ is known
// at SEEN_AT · `seen` and linear between.
float seen_transmittance(vec4 tau, float seen) {
    if (seen < 1e-2) return dot(exp(-tau), vec4(1.0, 3.0, 7.0, 5.0) / 16.0);   // by trapezia: f32 cancels below
    vec4 x = tau + SEEN_AT * seen, t = exp(-x);
    float sum = 0.0;
    for (int i = 0; i < 3; ++i) {
        float way = x[i + 1] - x[i];
        float mean = abs(way) < 1e-2 ? 0.5 * (t[i] + t[i + 1]) : (t[i] - t[i + 1]) / way;
        sum += (SEEN_AT[i + 1] - SEEN_AT[i]) * seen * mean;
    }
    return sum / (1.0 - exp(-seen));
}

#endif
