// `tables`: pre-computed single and multiple scattering (Yusov 4), and what other particles have scattered.
#include "lighting/tables/shade.glsl"
#include "lighting/attenuation/lookup.glsl"
#include "lighting/tables/diffusion/params.glsl"
layout(binding = 32, std430) restrict readonly buffer Lights { ParticleLight elements[]; } lights;
layout(binding = 33, std430) restrict readonly buffer Sky { SkyLight params; } sky_light;
layout(binding = 34) uniform sampler3D scattering_lut;
layout(binding = 35, std430) restrict readonly buffer Volume { VolumeParams params; } volume;
layout(binding = 36) uniform sampler3D light_volume;
layout(binding = 37, std430) restrict readonly buffer Attenuation { AttenuationParams params; } attenuation;
layout(binding = 38) uniform sampler3D attenuation_volume;
#include "lighting/tables/diffusion/lookup.glsl"
#include "lighting/tables/diffusion/seen.glsl"

// Share of the sunlight that other particles let through: from three points of the particle, or, where there is a volume, from
// points of the segment. The particle's own shade is part of its table.
float direct_sunlight(ParticleLight light, FrameParams f, Hit hit) {
    if (attenuation.params.levels == 0u) return dot(light.direct, axis_shares(f, hit));
    float seen = min(hit.extinction * (hit.t_exit - hit.t_enter), SEEN_DEPTH), metres = seen / hit.extinction;
    vec4 tau;
    for (int i = 0; i < 4; ++i) {
        vec3 at = f.camera + (hit.t_enter + SEEN_AT[i] * metres) * hit.dir;
        tau[i] = others_depth(attenuation_volume, at, hit.particle, attenuation.params);
    }
    return seen_transmittance(tau, seen);
}

vec3 source_radiance(Hit hit) {
    FrameParams f = frame.params;
    Particle p = hit.particle;
    ParticleLight light = lights.elements[hit.index];
    float others = 0.0;   // what others have scattered
    if (light.crowd > 0.0) {
        float seen = hit.t_enter + seen_depth(hit.extinction);
        if (volume.params.fitted == 1u) {
            // The fit holds near its middle (diffusion/seen.comp).
            float middle = hit.ray.t_closest - hit.ray.metres + seen_depth(f.sigma_t * p.density * p.fade * f.fill);
            seen = clamp(seen, middle - 0.25 * hit.ray.metres, middle + 0.25 * hit.ray.metres);
            others = max(dot(light.others.xyz, f.camera + seen * hit.dir) + light.others.w, 0.0);
        } else {
            others = light.crowd * volume_radiance(light_volume, f.camera + seen * hit.dir);
        }
    }
    return shade_tables(medium.params, sky_light.params, light, scattering_lut, f, hit, direct_sunlight(light, f, hit), others);
}
