// The source function of one segment (Yusov 4.4): single scattering with the phase function evaluated here, multiple
// scattering, what other particles have scattered, ambient light with the crease term.
#ifndef LIGHTING_TABLES_SHADE
#define LIGHTING_TABLES_SHADE
#include "lighting/skylight.glsl"
#include "lut/scattering_lookup.glsl"
#include "medium/phase.glsl"

// Light fades along the sun's axis, from the pole that faces it to the far one: what counts of the values at the near pole, at
// the centre and at the far pole where the eye meets the surface.
vec3 axis_shares(FrameParams frame, Hit hit) {
    float along = dot(hit.normal_us, normalize(to_unit_ball(hit.particle, vec4(frame.to_sun, 0.0))));
    float towards = max(along, 0.0), away = max(-along, 0.0);
    return vec3(towards, 1.0 - towards - away, away);
}

// Mean source function of sunlight and skylight along the ray. `direct`: share of the sunlight that other particles let
// through; `others`: what they have scattered, per irradiance of the sun [1/sr].
vec3 shade_tables(MediumParams medium, SkyLight sky, ParticleLight light, sampler3D scattering, FrameParams frame, Hit hit,
                  float direct, float others) {
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
    vec3 sunlight = sky.sun_irradiance_clouds * (medium.albedo * p_sun * single * direct
                                                 + multiple * dot(light.diffuse, axis_shares(frame, hit))
                                                 + others);

    return sunlight + skylight_radiance(medium, sky, hit, light.ambient);
}

#endif
