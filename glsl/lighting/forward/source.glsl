// `forward`: light that has come to the particle along each light's direction, scattered once towards the eye (Harris, Eq. 5).
// A segment gives (1 - T) C = a (1 - T) Σ p(cos θ) I E to the eye.
#include "atmosphere/params.glsl"
#include "lighting/forward/params.glsl"
#include "medium/phase.glsl"
layout(binding = 32, std430) restrict readonly buffer Incident { vec4 at[]; } incident;
layout(binding = 33, std430) restrict readonly buffer Sky { SkyLight params; } sky_light;
layout(binding = 34, std430) restrict readonly buffer Forward { ForwardParams params; } forward;

vec3 source_radiance(Hit hit) {
    vec4 light = incident.at[hit.index];
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < forward.params.count; ++i) {
        ForwardLight l = forward.params.light[i];
        vec3 irradiance = l.colour;
        if (l.from == FROM_SUN) irradiance *= sky_light.params.sun_irradiance_clouds;
        if (l.from == FROM_SKY) irradiance *= sky_light.params.sky_irradiance_clouds;
        float p = phase(dot(l.to_light, hit.dir), forward.params.g, forward.params.phase_function);
        sum += irradiance * (p * light[i]);
    }
    return forward.params.albedo * sum;
}
