// Mean radiance of the light that the clouds around a point scatter, per irradiance of the sun [1/sr].
// The includer declares, under this name, the readonly buffer `volume.params` (VolumeParams).
#ifndef WELKIN_VOLUME_LOOKUP
#define WELKIN_VOLUME_LOOKUP
#include "volume/params.glsl"

// The level in which a point is looked up, and where across it, [0, 1].
int volume_level(vec3 p_ws, out vec2 across) {
    // Levels reach twice as far each: one for each doubling of the distance, which the exponent of a float counts. Their
    // middles lie up to a voxel apart, so that this may be one too fine.
    vec2 out_there = abs(p_ws.xz - volume.params.bend) * volume.params.inverse_reach;
    int last = int(volume.params.levels) - 1, doublings = (floatBitsToInt(max(out_there.x, out_there.y)) >> 23) - 126;
    int level = clamp(doublings, 0, last);
    vec4 to_image = volume.params.across[level];
    across = p_ws.xz * to_image.z + to_image.xy;
    vec2 middle = abs(across - 0.5);
    if (max(middle.x, middle.y) > volume.params.rim && level < last) {
        to_image = volume.params.across[++level];
        across = p_ws.xz * to_image.z + to_image.xy;
    }
    return level;
}

// Height in the image, [0, 1].
float volume_up(vec3 p_ws, int level) {
    vec2 d = p_ws.xz - volume.params.bend;
    vec4 up = volume.params.up[level];
    return clamp((p_ws.y - volume.params.base + dot(d, d) * volume.params.inverse_diameter) * up.y + up.x, up.z, up.w);
}

float volume_radiance(sampler3D light_volume, vec3 p_ws) {
    vec2 across;
    int level = volume_level(p_ws, across);
    return textureLod(light_volume, vec3(across, volume_up(p_ws, level)), 0.0).x;
}

#endif
