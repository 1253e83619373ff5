#version 460
#extension GL_GOOGLE_include_directive : require
// Brings the cloud targets to full resolution and puts them over the background (Yusov 5.4: "upscaled to full resolution
// using edge-preserving bilateral filter").
//
// Catmull-Rom over 4×4 texels, each weighted by how well its opaque distance agrees with this pixel's, then clamped to
// the range of the agreeing inner 2×2: sharper than bilinear at cloud edges, no ringing, and nothing bleeds across the
// edges of opaque things. At equal resolution it is a copy. Cost: 32 fetches a pixel.
#include "film/upsample.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D cloud;            // low resolution: in-scattered radiance, transmittance
layout(binding = 1) uniform sampler2D low_opaque;       // low resolution: distance to the opaque scene [m]
layout(binding = 2) uniform sampler2D opaque_distance;  // full resolution [m]
layout(binding = 3) uniform sampler2D background;       // full resolution: radiance of sky and opaque scene
layout(binding = 4) restrict writeonly uniform image2D scene;   // radiance, transmittance of the clouds

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(scene);
    if (any(greaterThanEqual(pixel, size))) return;
    vec4 over = textureSize(cloud, 0) == size ? texelFetch(cloud, pixel, 0)
                                              : upsample(cloud, low_opaque, opaque_distance, pixel, size);
    vec3 behind = texelFetch(background, pixel, 0).rgb;
    imageStore(scene, pixel, vec4(over.rgb + over.a * behind, over.a));
}
