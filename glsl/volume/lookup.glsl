// Mean radiance of the light that the clouds around a point scatter, per irradiance of the sun [1/sr].
// The includer declares what volume/place.glsl asks for.
#ifndef WELKIN_VOLUME_LOOKUP
#define WELKIN_VOLUME_LOOKUP
#include "volume/place.glsl"

float volume_radiance(sampler3D light_volume, vec3 p_ws) {
    // Levels reach twice as far each. Their middles lie up to a voxel apart, so the first guess may be one too fine.
    vec2 d = abs(p_ws.xz - volume.params.bend);
    int doublings;
    frexp(max(d.x, d.y) * volume.params.inverse_reach, doublings);
    int last = int(volume.params.levels) - 1;
    uint level = uint(clamp(doublings, 0, last));
    vec2 place = volume_place(p_ws, level);
    if (volume_inside(place) < 0.0 && int(level) < last) place = volume_place(p_ws, ++level);
    vec2 stack = vec2(volume.params.stack[level].zw);
    float height = ldexp(volume_height(p_ws), -volume_doublings(level));
    float up = stack.x + clamp(height, 0.5, stack.y - 0.5);   // filtering stays within the level
    return textureLod(light_volume, vec3(place / float(volume.params.dim), up / float(volume.params.layers)), 0.0).x;
}

#endif
