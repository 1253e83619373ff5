#version 460
#extension GL_GOOGLE_include_directive : require
// Share of the sunlight that comes down through the clouds to points of the ground around the camera, by walking their
// light tiles' lists (Yusov 5.3). Cost: one list a texel.
//
// Most light under a thick cloud has been scattered on its way, so the shadow is not exp(-tau) but the two-stream
// transmittance of a conservative layer, 1 / (1 + 3/4 (1 - g) tau) (Bohren, "Multiple scattering of light and some of its
// observable consequences", 1987): an overcast day is grey, not black. That is r; g is what arrives from about the sun's
// own direction, for the shafts of light in the air: forward scattering leaves it there, exp(-(1 - g) tau).
#include "atmosphere/shadow_map.glsl"
#include "tiling/tile.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, std430) readonly restrict buffer TilingParamsBuffer { TilingParams tiling; } params;
layout(binding = 1, std430) readonly restrict buffer Occluders { Occluder by[]; } occluders;
layout(binding = 2, std430) readonly restrict buffer TileHeads { uint head[]; } tile_heads;
layout(binding = 3, std430) readonly restrict buffer TileNodes { TileNode node[]; } tile_nodes;
layout(binding = 4, rg16f) writeonly restrict uniform image2D cloud_shadow;
layout(push_constant) uniform CloudShadowPush {
    vec2 centre;  // of the map, relative to the floating origin [m]
    float extent; // half its side [m]
    float forward; // g, the asymmetry of cloud droplets
} push;
#include "lighting/sun_optical_depth.glsl"

// Light that comes in from beside the column that is looked through, which the two-stream layer does not know (tuned).
const float LEAST_SHARE = 0.15;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(cloud_shadow);
    if (any(greaterThanEqual(texel, size))) return;
    vec2 offset = offset_from_shadow_map(2.0 * (vec2(texel) + 0.5) / vec2(size) - 1.0, push.extent);
    float drop = dot(offset, offset) * params.tiling.inverse_diameter; // the planet falls away
    vec2 p = push.centre + offset;
    float tau = sun_optical_depth(vec3(p.x, -drop, p.y));
    float share = mix(LEAST_SHARE, 1.0, 1.0 / (1.0 + 0.75 * (1.0 - push.forward) * tau));
    imageStore(cloud_shadow, texel, vec4(share, exp(-(1.0 - push.forward) * tau), 0.0, 0.0));
}
