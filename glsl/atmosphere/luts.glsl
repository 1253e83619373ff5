// The tables of the clear air: for each one, how a texel is computed and, beside it, how it is looked up.
//
// Transmittance and multiple scattering depend on the air alone; sky view and aerial perspective also on the camera's
// altitude and the sun's elevation. After Bruneton 2008 (transmittance) and Hillaire 2020 (the rest), with two
// departures: single scattering by aerosols is stored without its phase function, which is applied after the look-up
// so that the aureole stays sharp; and aerial perspective lives in sun-relative directions instead of camera froxels,
// so that it does not change when the camera turns.
#ifndef ATMOSPHERE_LUTS_GLSL
#define ATMOSPHERE_LUTS_GLSL

#include "atmosphere/mapping.glsl"

// Steps of each integral; the error against a ten times finer integral is tested in src/reference/atmosphere.
const int TRANSMITTANCE_STEPS = 48;
const int MULTIPLE_DIRECTIONS = 64;
const int MULTIPLE_STEPS = 24;
const int SKY_VIEW_STEPS = 40;

// --- transmittance ----------------------------------------------------------------------------------------------------

// Optical depth [1] from h along a ray that nowhere descends; steps grow quadratically because density falls.
vec3 optical_depth_upwards(AirParams air, float h, float mu, float length_m) {
    vec3 tau = vec3(0.0);
    float begin = 0.0;
    for (int i = 1; i <= TRANSMITTANCE_STEPS; ++i) {
        float s = float(i) / float(TRANSMITTANCE_STEPS);
        float end = length_m * s * s;
        tau += air_at(air, altitude_along(air, h, mu, 0.5 * (begin + end))).extinction * (end - begin);
        begin = end;
    }
    return tau;
}

// Transmittance from h along mu to the top of the atmosphere. A descending ray is cut at its lowest point, from where
// both halves ascend.
vec3 compute_transmittance(AirParams air, float h, float mu) {
    float d_top = distance_to_top(air, h, mu);
    if (mu >= 0.0) return exp(-optical_depth_upwards(air, h, mu, d_top));
    float d_low = -(air.bottom_radius + h) * mu;
    float h_low = max(altitude_along(air, h, mu, d_low), 0.0);
    return exp(-optical_depth_upwards(air, h_low, 0.0, d_low) - optical_depth_upwards(air, h_low, 0.0, d_top - d_low));
}

vec3 transmittance_texel(AirParams air, ivec2 texel, ivec2 size) {
    vec2 ray = ray_from_transmittance(air, vec2(from_texel(texel.x, size.x), from_texel(texel.y, size.y)));
    return compute_transmittance(air, ray.x, ray.y);
}

vec3 transmittance_to_top(sampler2D table, AirParams air, float h, float mu) {
    ivec2 size = textureSize(table, 0);
    vec2 u = transmittance_from_ray(air, clamp(h, 0.0, air.top_height), mu);
    return textureLod(table, vec2(to_texture(u.x, size.x), to_texture(u.y, size.y)), 0.0).rgb;
}

// Transmittance to the sun's disc, the part of it below the horizon cut off.
vec3 transmittance_to_sun(sampler2D table, AirParams air, float h, float mu_s) {
    return transmittance_to_top(table, air, h, mu_s) * sun_visible_fraction(air, h, mu_s);
}

// --- multiple scattering ------------------------------------------------------------------------------------------------

// Direction i of n, evenly over the sphere (a Fibonacci spiral).
vec3 sphere_direction(int i, int n) {
    float y = 1.0 - (2.0 * float(i) + 1.0) / float(n);
    float phi = 2.39996322972865 * float(i); // golden angle
    float s = safe_sqrt(1.0 - y * y);
    return vec3(s * cos(phi), y, s * sin(phi));
}

// Radiance of all orders above the first, averaged over directions, per unit of solar irradiance [1/sr]: second order
// with an isotropic phase function, times the geometric series of its own transfer (Hillaire 2020, Eq. 5–10).
vec3 compute_multiple(sampler2D transmittance, AirParams air, float h, float mu_s) {
    vec3 second = vec3(0.0), transfer = vec3(0.0);
    float s_s = safe_sqrt(1.0 - mu_s * mu_s);
    for (int i = 0; i < MULTIPLE_DIRECTIONS; ++i) {
        vec3 direction = sphere_direction(i, MULTIPLE_DIRECTIONS);
        float mu = direction.y;
        float nu = mu * mu_s + direction.x * s_s;
        bool ground = hits_ground(air, h, mu);
        float length_m = ground ? distance_to_ground(air, h, mu) : distance_to_top(air, h, mu);
        vec3 through = vec3(1.0);
        float begin = 0.0;
        for (int k = 1; k <= MULTIPLE_STEPS; ++k) {
            float s = float(k) / float(MULTIPLE_STEPS);
            float end = length_m * s * s;
            float d = 0.5 * (begin + end), step_m = end - begin;
            float h_d = altitude_along(air, h, mu, d);
            AirSample a = air_at(air, h_d);
            vec3 sigma_s = a.rayleigh + a.mie;
            vec3 to_sun = transmittance_to_sun(transmittance, air, h_d, mu_along(air, h, mu_s, nu, h_d, d));
            second += through * step_radiance(sigma_s * to_sun, a.extinction, step_m) / (4.0 * AIR_PI);
            transfer += through * step_radiance(sigma_s, a.extinction, step_m);
            through *= exp(-a.extinction * step_m);
            begin = end;
        }
        if (ground) {
            float mu_s_ground = mu_along(air, h, mu_s, nu, 0.0, length_m);
            vec3 to_sun = transmittance_to_sun(transmittance, air, 0.0, mu_s_ground) * max(mu_s_ground, 0.0);
            second += through * to_sun * air.ground_albedo / AIR_PI;
        }
    }
    second /= float(MULTIPLE_DIRECTIONS);
    transfer /= float(MULTIPLE_DIRECTIONS);
    return second / (1.0 - transfer);
}

vec3 multiple_texel(sampler2D transmittance, AirParams air, ivec2 texel, ivec2 size) {
    vec2 point = point_from_multiple(air, vec2(from_texel(texel.x, size.x), from_texel(texel.y, size.y)));
    return compute_multiple(transmittance, air, point.x, point.y);
}

vec3 multiple_radiance(sampler2D table, AirParams air, float h, float mu_s) {
    ivec2 size = textureSize(table, 0);
    vec2 u = multiple_from_point(air, h, mu_s);
    return textureLod(table, vec2(to_texture(u.x, size.x), to_texture(u.y, size.y)), 0.0).rgb;
}

// --- airlight along a ray -------------------------------------------------------------------------------------------------

// What a ray gathers per unit of solar irradiance: Rayleigh and multiple scattering with their phase functions [1/sr],
// aerosol single scattering still without [1], and the optical depth passed [1].
struct Airlight {
    vec3 smooth_part;
    vec3 aerosol;
    vec3 optical_depth;
};

void step_airlight(sampler2D transmittance, sampler2D multiple, AirParams air, float h, float mu, float mu_s, float nu,
                   float begin, float end, inout Airlight light) {
    float d = 0.5 * (begin + end), step_m = end - begin;
    float h_d = max(altitude_along(air, h, mu, d), 0.0); // aerial perspective passes below sea level
    float mu_s_d = mu_along(air, h, mu_s, nu, h_d, d);
    AirSample a = air_at(air, h_d);
    vec3 to_sun = transmittance_to_sun(transmittance, air, h_d, mu_s_d);
    vec3 smooth_source = a.rayleigh * to_sun * rayleigh_phase(nu)
        + (a.rayleigh + a.mie) * multiple_radiance(multiple, air, h_d, mu_s_d);
    vec3 through = exp(-light.optical_depth);
    light.smooth_part += through * step_radiance(smooth_source, a.extinction, step_m);
    light.aerosol += through * step_radiance(a.mie * to_sun, a.extinction, step_m);
    light.optical_depth += a.extinction * step_m;
}

// Airlight along the whole ray, to the ground or to the top of the atmosphere.
Airlight compute_airlight(sampler2D transmittance, sampler2D multiple, AirParams air, float h, float mu, float mu_s,
                          float nu, bool ground, int steps) {
    float length_m = ground ? distance_to_ground(air, h, mu) : distance_to_top(air, h, mu);
    Airlight light = Airlight(vec3(0.0), vec3(0.0), vec3(0.0));
    float begin = 0.0;
    for (int i = 1; i <= steps; ++i) {
        float s = float(i) / float(steps);
        float end = length_m * s * s;
        step_airlight(transmittance, multiple, air, h, mu, mu_s, nu, begin, end, light);
        begin = end;
    }
    return light;
}

// Airlight of the stretch from x to y of a ray, as it arrives at the eye.
Airlight airlight_between(sampler2D transmittance, sampler2D multiple, AirParams air, float h, float mu, float mu_s,
                          float nu, vec2 stretch, int steps) {
    Airlight before = Airlight(vec3(0.0), vec3(0.0), vec3(0.0));
    if (stretch.y <= stretch.x) return before;
    float begin = 0.0;
    if (stretch.x > 0.0) {
        for (int i = 1; i <= steps / 2; ++i) {
            float end = stretch.x * float(i) / float(steps / 2);
            step_airlight(transmittance, multiple, air, h, mu, mu_s, nu, begin, end, before);
            begin = end;
        }
    }
    Airlight after = before;
    for (int i = 1; i <= steps; ++i) {
        float s = float(i) / float(steps);
        float end = stretch.x + (stretch.y - stretch.x) * s * s;
        step_airlight(transmittance, multiple, air, h, mu, mu_s, nu, begin, end, after);
        begin = end;
    }
    return Airlight(after.smooth_part - before.smooth_part, after.aerosol - before.aerosol,
                    after.optical_depth - before.optical_depth);
}

// The part of a sky-view value that comes from below altitude `base`.
Airlight sky_view_below(sampler2D transmittance, sampler2D multiple, AirParams air, float h, float mu_s, float base,
                        ivec2 texel, ivec2 size) {
    bool ground = texel.y < size.y / 2;
    vec2 direction = direction_from_sky_view(air, h, sky_view_texel(texel, size), ground);
    float nu = nu_from_azimuth(direction.x, mu_s, direction.y);
    vec2 stretch = stretch_below(air, h, direction.x, base);
    return airlight_between(transmittance, multiple, air, h, direction.x, mu_s, nu, stretch, SKY_VIEW_STEPS);
}

Airlight sky_view_value(sampler2D transmittance, sampler2D multiple, AirParams air, float h, float mu_s, ivec2 texel,
                        ivec2 size) {
    bool ground = texel.y < size.y / 2;
    vec2 direction = direction_from_sky_view(air, h, sky_view_texel(texel, size), ground);
    float nu = nu_from_azimuth(direction.x, mu_s, direction.y);
    return compute_airlight(transmittance, multiple, air, h, direction.x, mu_s, nu, ground, SKY_VIEW_STEPS);
}

#endif
