// `tables`: pre-computed single and multiple scattering (Yusov 4), and what other particles have scattered.
#include "lighting/tables/shade.glsl"
#include "lighting/tables/diffusion/params.glsl"
layout(binding = 32, std430) restrict readonly buffer Lights { ParticleLight elements[]; } lights;
layout(binding = 33, std430) restrict readonly buffer Sky { SkyLight params; } sky_light;
layout(binding = 34) uniform sampler3D scattering_lut;
layout(binding = 35, std430) restrict readonly buffer Volume { VolumeParams params; } volume;
layout(binding = 36) uniform sampler3D light_volume;
#include "lighting/tables/diffusion/lookup.glsl"
#include "lighting/tables/diffusion/seen.glsl"

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
    return shade_tables(medium.params, sky_light.params, light, scattering_lut, f, hit, others);
}
