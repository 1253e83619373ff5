// Mean radiance of the light that the clouds around a point scatter, per irradiance of the sun [1/sr].
// The includer declares what volume/place.glsl asks for.
#ifndef WELKIN_VOLUME_LOOKUP
#define WELKIN_VOLUME_LOOKUP
#include "volume/place.glsl"

const float VOLUME_RIM = 2.0;     // voxels at the border of a level that are not looked at
const float VOLUME_BLEND = 6.0;   // voxels next to these, over which a level passes into the next coarser one

float volume_level_radiance(sampler3D light_volume, vec2 place, float height, uint level) {
    vec2 stack = vec2(volume.params.stack[level].zw);
    float up = clamp(ldexp(height, -volume_doublings(level)), 0.5, stack.y - 0.5) + stack.x;   // filtering stays within the level
    return textureLod(light_volume, vec3(place / float(volume.params.dim), up / float(volume.params.layers)), 0.0).x;
}

// How far a position in a level lies from what is not looked at [voxels].
float volume_inside(vec2 place) {
    return min(min(place.x, place.y), float(volume.params.dim) - max(place.x, place.y)) - VOLUME_RIM;
}

float volume_radiance(sampler3D light_volume, vec3 p_ws) {
    if (volume.params.levels == 0u) return 0.0;
    float height = volume_height(p_ws);
    uint level = 0u;
    vec2 place = volume_place(p_ws, level);
    while (volume_inside(place) <= 0.0 && level + 1u < volume.params.levels) place = volume_place(p_ws, ++level);
    float inside = volume_inside(place);
    float radiance = volume_level_radiance(light_volume, place, height, level);
    if (inside < VOLUME_BLEND && level + 1u < volume.params.levels) {
        float coarser = volume_level_radiance(light_volume, volume_place(p_ws, level + 1u), height, level + 1u);
        radiance = mix(coarser, radiance, inside / VOLUME_BLEND);
    }
    return radiance;
}

#endif
