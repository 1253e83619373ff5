#version 460
#extension GL_GOOGLE_include_directive : require
// Light of sun, sky and ground on clouds and ground, at one altitude each. One group; 256 directions, 24 steps each,
// three times. Ground and sky over it lie under clouds: both are dimmed by what the clouds let through on the mean of some
// 25 km around the camera, or the undersides of an overcast deck would be lit by sunny meadows. The sums are trees over a fixed order, so the result does not depend on scheduling.
#include "atmosphere/sky.glsl"
const int DIRECTIONS = 256;
const int STEPS = 24;
// Irradiance from diffusing clouds as part of the sun's on level ground: the two-stream transmittance
// 1/(1 + 3/4 τ(1 − g)) of a layer with τ = 30, g = 0.85.
const float CLOUD_GLOW = 0.23;
layout(local_size_x = DIRECTIONS) in;
const uint SKY_NONE = 0u;         // the sun shines undimmed
const uint SKY_ATMOSPHERE = 1u;
layout(constant_id = 0) const uint SKY_MODEL = SKY_ATMOSPHERE;
layout(binding = 0, std430) restrict readonly buffer Air { AirParams params; } air;
layout(binding = 1, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 2) uniform sampler2D transmittance_lut;
layout(binding = 3) uniform sampler2D multiple_lut;
layout(binding = 5) uniform sampler2D cloud_shadow;
layout(binding = 4, std430) restrict writeonly buffer Light { SkyLight params; } sky_light;
layout(push_constant) uniform SkyLightPush {
    float cloud_altitude; // [m]
    uint shadowed;        // 0: there is no shadow map
} push;

shared vec3 partial[DIRECTIONS];

// Irradiance per unit of solar irradiance on a horizontal plane at altitude h. Directions are weighted by their cosine:
// points of a sunflower disc, lifted to the hemisphere.
vec3 horizontal_irradiance(float h, float mu_s, bool up, vec3 ground) {
    int i = int(gl_LocalInvocationIndex);
    float r2 = (float(i) + 0.5) / float(DIRECTIONS);
    float mu = up ? sqrt(1.0 - r2) : -sqrt(1.0 - r2);
    float nu = nu_from_azimuth(mu, mu_s, 2.39996322972865 * float(i));
    bool below = hits_ground(air.params, h, mu);
    Airlight light = compute_airlight(transmittance_lut, multiple_lut, air.params, h, mu, mu_s, nu, below, STEPS);
    vec3 radiance = light.smooth_part + light.aerosol * mie_phase(nu, air.params.mie_g);
    if (below) radiance += ground * exp(-light.optical_depth);
    barrier();
    partial[i] = radiance;
    for (int width = DIRECTIONS / 2; width > 0; width /= 2) {
        barrier();
        if (i < width) partial[i] += partial[i + width];
    }
    barrier();
    return partial[0] * (AIR_PI / float(DIRECTIONS));
}

// Mean share of sunlight that the clouds let through to the ground: 16 × 16 places of the inner part of the map.
float mean_cloud_transmittance() {
    int i = int(gl_LocalInvocationIndex);
    vec2 u = (vec2(i & 15, i >> 4) + 0.5) / 8.0 - 1.0;
    barrier();
    partial[i] = push.shadowed == 0u ? vec3(1.0) : textureLod(cloud_shadow, 0.5 + 0.2 * u, 0.0).rrr;
    for (int width = DIRECTIONS / 2; width > 0; width /= 2) {
        barrier();
        if (i < width) partial[i] += partial[i + width];
    }
    barrier();
    return partial[0].r / float(DIRECTIONS);
}

void main() {
    SkyLight light;
    light.reserved_a = light.reserved_b = light.reserved_c = light.reserved_d = light.reserved_e = 0.0;
    if (SKY_MODEL == SKY_NONE) {
        light.sun_irradiance_clouds = light.sun_irradiance_ground = air.params.solar_irradiance;
        light.sky_irradiance_clouds = light.ground_irradiance_clouds = light.sky_irradiance_ground = vec3(0.0);
    } else {
        vec3 solar = air.params.solar_irradiance;
        float mu_s = frame.params.to_sun.y;
        float h = clamp(push.cloud_altitude, 1.0, air.params.top_height - 1.0);
        vec3 sun_ground = transmittance_to_sun(transmittance_lut, air.params, 0.0, mu_s);
        float under_clouds = mean_cloud_transmittance();
        vec3 sky_ground = under_clouds * horizontal_irradiance(0.0, mu_s, true, vec3(0.0));
        vec3 ground = air.params.ground_albedo / AIR_PI * (sun_ground * (under_clouds * max(mu_s, 0.0)) + sky_ground);
        // Where a cloud does not see the sky it sees other clouds, which glow white with the sunlight they diffuse.
        vec3 sun_clouds = transmittance_to_sun(transmittance_lut, air.params, h, mu_s);
        vec3 from_clouds = sun_clouds * (CLOUD_GLOW * max(mu_s, 0.0));
        light.sky_irradiance_clouds =
            solar * mix(from_clouds, horizontal_irradiance(h, mu_s, true, vec3(0.0)), under_clouds);
        light.ground_irradiance_clouds = solar * horizontal_irradiance(h, mu_s, false, ground);
        light.sun_irradiance_clouds = solar * sun_clouds;
        light.sun_irradiance_ground = solar * sun_ground;
        light.sky_irradiance_ground = solar * sky_ground;
    }
    if (gl_LocalInvocationIndex == 0u) sky_light.params = light;
}
