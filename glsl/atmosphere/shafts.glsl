// Shadows of the clouds in the air below them: the airlight of the stretch of a view ray that runs below the cloud base
// is dimmed by the mean visibility of the sun along it. Clouds lie above their base, so one mean serves what is seen of
// cloud and of background alike.
#ifndef ATMOSPHERE_SHAFTS_GLSL
#define ATMOSPHERE_SHAFTS_GLSL

#include "atmosphere/shadow_map.glsl"
#include "atmosphere/sky.glsl"

// Part of the sunlight on a cumulus that leaves its base again, diffusely: two-stream, 1/(1 + 3/4 τ(1 − g)) for τ = 30,
// g = 0.85 (see cloud_shadow.comp).
const float CLOUD_DIFFUSE_TRANSMITTANCE = 0.23;

const int SHAFT_STEPS = 12; // of each texel; 16 texels share their samples
const float SHAFT_DISTANCE_MAX = 60e3; // [m]; farther air is taken as the mean of the nearer

// Part of smooth airlight that is single scattering of direct sunlight, which shadows take away; the rest is multiple
// scattering (between 0.4 and 0.7 below 3 km by the oracle's tables).
const float SMOOTH_SINGLE_PART = 0.5;

// Mean visibility of the sun along the stretch, each metre weighted by the haze in it and the air before it.
// `shift` in [0, 1) moves the samples.
float shaft_visibility(sampler2D cloud_shadow, AirParams air, FrameParams frame, vec2 shadow_centre, float shadow_extent,
                       float h, vec3 view, vec2 stretch, float shift) {
    if (shadow_extent <= 0.0 || stretch.y <= stretch.x || frame.to_sun.y < 0.01) return 1.0;
    float length_m = min(stretch.y - stretch.x, SHAFT_DISTANCE_MAX);
    float extinction = air.mie_extinction.g + air.rayleigh_scattering.g;
    float sum = 0.0, weights = 0.0;
    for (int i = 0; i < SHAFT_STEPS; ++i) {
        float s = (float(i) + shift) / float(SHAFT_STEPS);
        float t = stretch.x + length_m * s * s;
        float altitude = max(altitude_along(air, h, view.y, t), 0.0);
        vec2 p = frame.camera.xz + t * view.xz - frame.to_sun.xz * (altitude / frame.to_sun.y) - shadow_centre;
        vec2 u = shadow_map_from_offset(p, shadow_extent);
        float inside = 1.0 - smoothstep(0.85, 1.0, max(abs(u.x), abs(u.y)));
        float shadow = inside > 0.0 ? mix(1.0, textureLod(cloud_shadow, 0.5 + 0.5 * u, 0.0).g, inside) : 1.0;
        float weight = s * exp(-altitude / air.mie_scale_height - extinction * t); // s: length of the step
        sum += weight * shadow;
        weights += weight;
    }
    return weights > 0.0 ? sum / weights : 1.0;
}

// Samples of a texel are moved by one of sixteen shifts, each of which occurs once in every 4 × 4 texels (Bayer 1973):
// the mean of such a square is an integral of 16 times as many steps, without a pattern.
float shaft_shift(ivec2 texel) {
    ivec2 a = texel & 1, b = (texel >> 1) & 1;
    int order = 4 * (2 * (a.x ^ a.y) + a.y) + 2 * (b.x ^ b.y) + b.y;
    return (float(order) + 0.5) / 16.0;
}

// The smoothed visibility at a place of the image; its texels stand for their far corners.
float shaft_visibility_at(sampler2D smooth_visibility, vec2 uv) {
    return textureLod(smooth_visibility, uv - 0.5 / vec2(textureSize(smooth_visibility, 0)), 0.0).r;
}

// What shadow takes from the airlight: of single scattering the part of the stretch that is not visible to the sun; in
// its place comes what the clouds let through, scattered evenly.
// The tables hold the airlight of the stretch by direction, as the sky view does.
vec3 shaft_loss(sampler2D below_smooth_table, sampler2D below_aerosol_table, AirParams air, float h, vec3 view,
                vec3 to_sun, float visibility) {
    if (visibility >= 1.0) return vec3(0.0);
    vec2 u = sky_view_from_direction(air, h, view.y, azimuth_from_sun(view, to_sun));
    vec2 uv = sky_view_texture(u, hits_ground(air, h, view.y), textureSize(below_smooth_table, 0));
    vec3 smooth_part = textureLod(below_smooth_table, uv, 0.0).rgb;
    vec3 aerosol = textureLod(below_aerosol_table, uv, 0.0).rgb;
    float nu = dot(view, to_sun);
    float evenly = CLOUD_DIFFUSE_TRANSMITTANCE / (4.0 * AIR_PI);
    return air.solar_irradiance * (1.0 - visibility)
        * (smooth_part * (SMOOTH_SINGLE_PART * (1.0 - CLOUD_DIFFUSE_TRANSMITTANCE))
           + aerosol * max(mie_phase(nu, air.mie_g) - evenly, 0.0));
}

#endif
