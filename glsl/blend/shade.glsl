// One particle along one view ray → one segment (Yusov 4.4): exact optical depth, single scattering with the phase
// function evaluated here, multiple scattering, ambient light with the crease term, detail noise.
#ifndef BLEND_SHADE
#define BLEND_SHADE
#include "atmosphere/params.glsl"
#include "blend/ellipsoid.glsl"
#include "blend/merge.glsl"
#include "detail/displace.glsl"
#include "lut/optical_depth_lookup.glsl"
#include "lut/scattering_lookup.glsl"
#include "medium/phase.glsl"
#include "volume/params.glsl"

// What the clouds are made of. Twin: src/blend/medium.rs.
struct MediumParams {
    float g_single;         // asymmetry of the event that meets the sun
    uint  phase_function;   // PHASE_*
    float albedo;           // single-scattering albedo
    float crease;           // strength of the crease term [1]
    float detail;           // strength of the detail noise [1]; 0 turns it off
    float relief;           // how much of the noise's slope turns the surface for lighting [1]
    float reserved_a;
    float reserved_b;
};

const float PI = 3.14159265358979;

// Radiance of cloud in front of the sky, as share of the mean of sky and ground (fitted to path-traced skies).
const float CLOUD_SKYLIGHT = 0.75;

const uint LIGHTING_TABLES = 0u;
const uint LIGHTING_FLAT = 1u;

// Mean source function of sunlight and skylight along the ray: the colour C of the segment.
// `entry_us` is where the lit surface lies and `mu` the cosine of incidence, after detail has moved both.
vec3 shade_tables(MediumParams medium, SkyLight sky, ParticleLight light, sampler3D scattering, FrameParams frame, Particle p,
                  BallRay ray, vec3 entry_us, vec3 dir, vec3 normal_ws, float tau_chord, float first_matter, float others) {
    vec3 to_sun_us = normalize(to_unit_ball(p, vec4(frame.to_sun, 0.0)));
    float mu = max(-dot(entry_us, ray.dir_us), 1e-3);
    // Single scattering: of the homogeneous sphere in which this chord has this optical depth.
    float radius_single = tau_chord / (2.0 * mu);
    // Multiple scattering is a matter of the whole particle.
    float radius_multiple = frame.sigma_t * p.density * p.fade * frame.fill * ray.metres;
    float single = scattering_source_lookup(scattering, entry_us, ray.dir_us, to_sun_us, radius_single).x;
    float multiple = scattering_source_lookup(scattering, entry_us, ray.dir_us, to_sun_us, radius_multiple).y;
    float p_sun = phase(dot(frame.to_sun, dir), medium.g_single, medium.phase_function);
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
    float up = 0.5 + 0.5 * normal_ws.y;
    float crease = 1.0 + medium.crease * (first_matter - 0.25);
    vec3 seen = mix(sky.ground_irradiance_clouds, sky.sky_irradiance_clouds, up) * crease;
    vec3 cloud = (0.5 * CLOUD_SKYLIGHT) * (sky.ground_irradiance_clouds + sky.sky_irradiance_clouds);
    vec3 skylight = mix(cloud, seen, light.ambient) / PI;
    return sunlight + skylight;
}

#endif
