// Mean radiance of the light that the clouds around a point scatter, per irradiance of the sun [1/sr], where the volume is one
// box and not fitted. The includer declares what diffusion/place.glsl asks for.
#ifndef WELKIN_VOLUME_LOOKUP
#define WELKIN_VOLUME_LOOKUP
#include "lighting/tables/diffusion/place.glsl"

float volume_radiance(sampler3D light_volume, vec3 p_ws) {
    vec2 across = volume_place(p_ws, 0u) / float(volume.params.dim);
    return textureLod(light_volume, vec3(across, volume_height(p_ws) / float(volume.params.layers)), 0.0).x;
}

#endif
