// What a pixel asks of the air: the sky behind everything, and the air in front of things. An atmosphere that is to
// replace this one keeps these functions.
#ifndef ATMOSPHERE_SKY_GLSL
#define ATMOSPHERE_SKY_GLSL

#include "atmosphere/luts.glsl"
#include "common/frame.glsl"

// Distance to which aerial perspective is tabulated [m]; farther clouds are taken to be there.
const float AERIAL_DISTANCE_MAX = 160e3;
const int AERIAL_STEPS = 2; // between two tabulated distances

// Exponent of the limb darkening mu^alpha for red, green, blue (Neckel 1996, as tabulated by Hillaire 2020).
const vec3 LIMB_DARKENING = vec3(0.397, 0.503, 0.652);

// The camera's altitude [m]; the eye is at least a metre above the ground and inside the air.
float camera_altitude(AirParams air, FrameParams frame) {
    return clamp(frame.camera.y + frame.origin.y, 1.0, air.top_height - 1.0);
}

// Radiance from the two tabulated parts of airlight.
vec3 airlight_radiance(AirParams air, vec3 smooth_part, vec3 aerosol, float nu) {
    return air.solar_irradiance * (smooth_part + aerosol * mie_phase(nu, air.mie_g));
}

// Airlight along the whole ray: to the ground if it meets it, else to the top of the atmosphere. `ground` says which
// half of the table to read; it has to fit the ray, or be that of the other side within a pixel of the horizon.
vec3 sky_radiance(sampler2D smooth_table, sampler2D aerosol_table, AirParams air, float h, vec3 view, vec3 to_sun) {
    float azimuth = azimuth_from_sun(view, to_sun);
    bool ground = hits_ground(air, h, view.y);
    vec2 u = sky_view_from_direction(air, h, view.y, azimuth);
    vec2 texture_uv = sky_view_texture(u, ground, textureSize(smooth_table, 0));
    return airlight_radiance(air, textureLod(smooth_table, texture_uv, 0.0).rgb,
                             textureLod(aerosol_table, texture_uv, 0.0).rgb, dot(view, to_sun));
}

// Airlight between the eye and a distance, as its two parts per unit of solar irradiance.
struct AerialParts {
    vec3 smooth_part; // [1/sr]
    vec3 aerosol;     // without its phase function [1]
};

AerialParts aerial_parts(sampler3D smooth_table, sampler3D aerosol_table, float distance, vec3 view, vec3 to_sun) {
    float d = clamp(distance, 0.0, AERIAL_DISTANCE_MAX);
    vec3 u = aerial_from_ray(view.y, azimuth_from_sun(view, to_sun), d, AERIAL_DISTANCE_MAX);
    ivec3 size = textureSize(smooth_table, 0);
    u = vec3(to_texture(u.x, size.x), to_texture(u.y, size.y), to_texture(u.z, size.z));
    float km = 1e-3 * d; // the tables hold means per kilometre
    return AerialParts(km * textureLod(smooth_table, u, 0.0).rgb, km * textureLod(aerosol_table, u, 0.0).rgb);
}

struct AerialPerspective {
    vec3 inscatter;     // airlight between the eye and the distance
    vec3 transmittance; // of the air in between
};

AerialPerspective aerial_perspective(sampler3D smooth_table, sampler3D aerosol_table, sampler2D extinction_table,
                                     AirParams air, float distance, vec3 view, vec3 to_sun) {
    float d = min(distance, AERIAL_DISTANCE_MAX);
    AerialParts parts = aerial_parts(smooth_table, aerosol_table, d, view, to_sun);
    AerialPerspective aerial;
    aerial.inscatter = airlight_radiance(air, parts.smooth_part, parts.aerosol, dot(view, to_sun));
    vec2 u = aerial_from_ray(view.y, 0.0, d, AERIAL_DISTANCE_MAX).yz;
    ivec2 size = textureSize(extinction_table, 0);
    u = vec2(to_texture(u.x, size.x), to_texture(u.y, size.y));
    aerial.transmittance = exp(-1e-3 * d * textureLod(extinction_table, u, 0.0).rgb); // mean per kilometre
    return aerial;
}

// Transmittance of the air from the eye to the ground along a ray that meets it: a quotient of two rays to the top,
// taken upwards from the ground, where neither is nearly opaque unless the whole way is.
vec3 transmittance_to_ground(sampler2D table, AirParams air, float h, float mu, float distance) {
    vec3 from_ground = transmittance_to_top(table, air, 0.0, -mu_along(air, h, mu, 1.0, 0.0, distance));
    vec3 from_eye = transmittance_to_top(table, air, h, -mu);
    return min(from_ground / max(from_eye, vec3(1e-6)), vec3(1.0));
}

// Radiance of the sun's disc outside the atmosphere; `pixel` is the angle of a pixel, over which the edge is smoothed.
vec3 sun_disc_radiance(AirParams air, vec3 view, vec3 to_sun, float pixel) {
    if (dot(view, to_sun) <= 0.0) return vec3(0.0);
    float angle = asin(min(length(cross(view, to_sun)), 1.0)); // the cosine would not resolve it
    float coverage = clamp((air.sun_angular_radius - angle) / pixel + 0.5, 0.0, 1.0);
    if (coverage <= 0.0) return vec3(0.0);
    float x = min(angle / air.sun_angular_radius, 0.999);
    vec3 limb = 0.5 * (LIMB_DARKENING + 2.0) * pow(vec3(safe_sqrt(1.0 - x * x)), LIMB_DARKENING);
    float solid_angle = AIR_PI * air.sun_angular_radius * air.sun_angular_radius;
    return air.solar_irradiance * limb * (coverage / solid_angle);
}

#endif
