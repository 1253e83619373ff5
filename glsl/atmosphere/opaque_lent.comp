#version 460
// Puts the host's opaque scene before the planet: the nearer of both distances; and where the host's surface is the
// nearer one, it is not for us to draw what is behind it.
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D lent;   // distance along the unit view ray [m], 1e30 for none
layout(binding = 1, r32f) restrict uniform image2D opaque_distance;
layout(binding = 2) restrict writeonly uniform image2D radiance;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(opaque_distance)))) return;
    float theirs = texelFetch(lent, pixel, 0).r, ours = imageLoad(opaque_distance, pixel).r;
    if (theirs < ours) {
        imageStore(opaque_distance, pixel, vec4(theirs));
        imageStore(radiance, pixel, vec4(0.0, 0.0, 0.0, 1.0));
    }
}
