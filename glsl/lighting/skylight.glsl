// Light of sky and ground on cloud.
#ifndef WELKIN_LIGHTING_SKYLIGHT
#define WELKIN_LIGHTING_SKYLIGHT
#include "atmosphere/params.glsl"
#include "lighting/hit.glsl"
#include "medium/params.glsl"

const float PI = 3.14159265358979;

// Radiance of cloud in front of the sky, as share of the mean of sky and ground (fitted to path-traced skies).
const float CLOUD_SKYLIGHT = 0.75;

// Sky and ground as two half-spheres of constant radiance E / π, seen by the surface; creases, which lie deep below the
// ellipsoid, are brighter than edges (Yusov 4.4). Where neighbouring cloud stands before the sky, it shines instead
// with the mean of both, less what it lets through to the other side: without absorption shade is not black.
// `open`: share of the sky that is no cloud.
vec3 skylight_radiance(MediumParams medium, SkyLight sky, Hit hit, float open) {
    float up = 0.5 + 0.5 * hit.normal_ws.y;
    float crease = 1.0 + medium.crease * (hit.first_matter - 0.25);
    vec3 seen = mix(sky.ground_irradiance_clouds, sky.sky_irradiance_clouds, up) * crease;
    vec3 cloud = (0.5 * CLOUD_SKYLIGHT) * (sky.ground_irradiance_clouds + sky.sky_irradiance_clouds);
    return mix(cloud, seen, open) / PI;
}

#endif
