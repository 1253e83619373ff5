#version 460
#extension GL_GOOGLE_include_directive : require
// Mean of the 4 × 4 texels around each texel's far corner: in every such square each shift of the samples along the ray
// occurs once (shaft_shift), so the mean has no pattern.
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D visibility;
layout(binding = 1, r16f) restrict writeonly uniform image2D smooth_visibility;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(smooth_visibility);
    if (any(greaterThanEqual(texel, size))) return;
    float sum = 0.0;
    for (int y = -1; y <= 2; ++y) {
        for (int x = -1; x <= 2; ++x) {
            sum += texelFetch(visibility, clamp(texel + ivec2(x, y), ivec2(0), size - 1), 0).r;
        }
    }
    imageStore(smooth_visibility, texel, vec4(sum / 16.0));
}
