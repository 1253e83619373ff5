// The source function of one segment (Yusov 4.4): single scattering with the phase function evaluated here, multiple
// scattering, what other particles have scattered, ambient light with the crease term.
#ifndef LIGHTING_TABLES_SHADE
#define LIGHTING_TABLES_SHADE
#include "atmosphere/params.glsl"
#include "lighting/hit.glsl"
#include "lut/scattering_lookup.glsl"
#include "medium/params.glsl"
#include "medium/phase.glsl"

const float PI = 3.14159265358979;

// Radiance of cloud in front of the sky, as share of the mean of sky and ground (fitted to path-traced skies).
const float CLOUD_SKYLIGHT = 0.75;

// Mean source function of sunlight and skylight along the ray. `others`: what other particles have scattered, per irradiance
// of the sun [1/sr].
vec3 shade_tables(MediumParams medium, SkyLight sky, ParticleLight light, sampler3D scattering, FrameParams frame, Hit hit,
                  float others) {
    Particle p = hit.particle;
    BallRay ray = hit.ray;
    vec3 entry_us = hit.normal_us;   // detail has moved where the lit surface lies, and the cosine of incidence with it
    vec3 to_sun_us = normalize(to_unit_ball(p, vec4(frame.to_sun, 0.0)));
    float mu = max(-dot(entry_us, ray.dir_us), 1e-3);
    // Single scattering: of the homogeneous sphere in which this chord has this optical depth.
    float radius_single = hit.chord_depth / (2.0 * mu);
    // Multiple scattering is a matter of the whole particle.
    float radius_multiple = frame.sigma_t * p.density * p.fade * frame.fill * ray.metres;
    float single = scattering_source_lookup(scattering, entry_us, ray.dir_us, to_sun_us, radius_single).x;
    float multiple = scattering_source_lookup(scattering, entry_us, ray.dir_us, to_sun_us, radius_multiple).y;
    float p_sun = phase(dot(frame.to_sun, hit.dir), medium.g_single, medium.phase_function);
    // Light fades along the sun's axis, from the pole that faces it to the far one.
    float along = dot(entry_us, to_sun_us);
    float towards = max(along, 0.0), away = max(-along, 0.0);
    vec3 share = vec3(towards, 1.0 - towards - away, away);
    vec3 sunlight = sky.sun_irradiance_clouds * (medium.albedo * p_sun * single * dot(light.direct, share)
                                                 + multiple * dot(light.diffuse, share)
                                                 + others);

    // Sky and ground as two half-spheres of constant radiance E / π, seen by the surface; creases, which lie deep below the
    // ellipsoid, are brighter than edges (Yusov 4.4). Where neighbouring cloud stands before the sky, it shines instead
    // with the mean of both, less what it lets through to the other side: without absorption shade is not black.
    float up = 0.5 + 0.5 * hit.normal_ws.y;
    float crease = 1.0 + medium.crease * (hit.first_matter - 0.25);
    vec3 seen = mix(sky.ground_irradiance_clouds, sky.sky_irradiance_clouds, up) * crease;
    vec3 cloud = (0.5 * CLOUD_SKYLIGHT) * (sky.ground_irradiance_clouds + sky.sky_irradiance_clouds);
    vec3 skylight = mix(cloud, seen, light.ambient) / PI;
    return sunlight + skylight;
}

#endif
