#version 460
#extension GL_GOOGLE_include_directive : require
// The opaque scene's distance at the resolution of the cloud targets: the nearest and the farthest of each block in
// turn, like a checkerboard, so that upsampling finds a fitting neighbour on either side of an edge.
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D opaque_distance;
layout(binding = 1, r32f) restrict writeonly uniform image2D opaque_low;
layout(push_constant) uniform OpaqueReducePush {
    uint downscale;
} push;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, imageSize(opaque_low)))) return;
    ivec2 last = textureSize(opaque_distance, 0) - 1;
    int n = int(push.downscale);
    float nearest = 1e30, farthest = 0.0;
    for (int y = 0; y < n; ++y) {
        for (int x = 0; x < n; ++x) {
            float d = texelFetch(opaque_distance, min(texel * n + ivec2(x, y), last), 0).r;
            nearest = min(nearest, d);
            farthest = max(farthest, d);
        }
    }
    imageStore(opaque_low, texel, vec4(((texel.x + texel.y) & 1) == 0 ? nearest : farthest));
}
