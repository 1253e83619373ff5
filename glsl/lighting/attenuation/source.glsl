// `attenuation`: sunlight from the volume in every pixel, scattered once, and more often by two streams (Shimada 3).
#include "lighting/attenuation/lookup.glsl"
#include "lighting/attenuation/streams.glsl"
#include "lighting/skylight.glsl"
#include "medium/phase.glsl"
layout(binding = 32, std430) restrict readonly buffer Sky { SkyLight params; } sky_light;
layout(binding = 33, std430) restrict readonly buffer Attenuation { AttenuationParams params; } attenuation;
layout(binding = 34) uniform sampler3D attenuation_volume;

vec3 source_radiance(Hit hit) {
    vec3 camera = frame.params.camera;
    float seen = min(hit.extinction * (hit.t_exit - hit.t_enter), SEEN_DEPTH), metres = seen / hit.extinction;
    vec4 tau;
    for (int i = 0; i < 4; ++i) {
        vec3 at = camera + (hit.t_enter + SEEN_AT[i] * metres) * hit.dir;
        tau[i] = sun_depth(attenuation_volume, at, attenuation.params);
    }
    float column = column_depth(attenuation_volume, camera + (hit.t_enter + SEEN_AT[1] * metres) * hit.dir, attenuation.params);
    float p_sun = phase(dot(frame.params.to_sun, hit.dir), medium.params.g_single, medium.params.phase_function);
    // Light that has been scattered changes slowly: its mean over the segment is that at the mean depth.
    float mean = dot(tau, vec4(1.0, 3.0, 7.0, 5.0) / 16.0);
    float streams = streams_radiance(mean, max(column, mean), attenuation.params.asymmetry);
    vec3 sunlight = sky_light.params.sun_irradiance_clouds * medium.params.albedo
                  * (p_sun * seen_transmittance(tau, seen) + streams);
    // Diffuse light fares like the sun's from scattering to scattering: what shades the sun stands for what hides the sky.
    float open = streams_transmittance(mean, attenuation.params.asymmetry);
    return sunlight + skylight_radiance(medium.params, sky_light.params, hit, open);
}
