#version 460
#extension GL_GOOGLE_include_directive : require
// Brings the cloud targets to full resolution and puts them over the background (Yusov 5.4: "upscaled to full resolution
// using edge-preserving bilateral filter").
//
// Catmull-Rom over 4×4 texels where their opaque distances agree with this pixel's, clamped to the range of the inner
// 2×2; bilinear over the agreeing ones elsewhere: sharper than bilinear at cloud edges, no ringing, and nothing bleeds
// across the edges of opaque things. At equal resolution it is a copy. Cost: 1.5 + 2 fetches a pixel (96 texels of two
// images for 128 pixels), 16 reads of shared memory.
#include "film/upsample.glsl"
layout(local_size_x = 16, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D cloud;            // low resolution: in-scattered radiance, transmittance
layout(binding = 1) uniform sampler2D low_opaque;       // low resolution: distance to the opaque scene [m]
layout(binding = 2) uniform sampler2D opaque_distance;  // full resolution [m]
layout(binding = 3) uniform sampler2D background;       // full resolution: radiance of sky and opaque scene
layout(binding = 4) restrict writeonly uniform image2D scene;   // radiance, transmittance of the clouds

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(scene), low_size = textureSize(cloud, 0);
    bool inside = all(lessThan(pixel, size));
    vec4 over;
    if (low_size == size) {
        if (!inside) return;
        over = texelFetch(cloud, pixel, 0);
    } else {
        ivec2 origin = tile_origin(ivec2(gl_WorkGroupID.xy) * TILE_PIXELS, size, low_size);
        load_tile(cloud, low_opaque, origin, int(gl_LocalInvocationIndex));
        if (!inside) return;
        float distance = texelFetch(opaque_distance, pixel, 0).x;
        over = upsample(distance, texel_position(pixel, size, low_size), origin);
    }
    vec3 behind = texelFetch(background, pixel, 0).rgb;
    imageStore(scene, pixel, vec4(over.rgb + over.a * behind, over.a));
}
