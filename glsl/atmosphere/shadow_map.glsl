// The map of the clouds' shadows on the ground: a square around the camera whose texels grow with distance.
#ifndef ATMOSPHERE_SHADOW_MAP_GLSL
#define ATMOSPHERE_SHADOW_MAP_GLSL

// Offset from the map's centre [m] → [-1, 1]², by the signed square root of each axis.
vec2 shadow_map_from_offset(vec2 d, float extent) { return sign(d) * sqrt(abs(d) / extent); }

// [-1, 1]² → offset from the map's centre [m].
vec2 offset_from_shadow_map(vec2 u, float extent) { return u * abs(u) * extent; }

#endif
