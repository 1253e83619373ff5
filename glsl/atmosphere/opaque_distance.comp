#version 460
#extension GL_GOOGLE_include_directive : require
// Distance along the unit view ray to the opaque scene [m], 1e30 where there is none: the bare planet.
#include "atmosphere/sky.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, std430) restrict readonly buffer Air { AirParams params; } air;
layout(binding = 1, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 2, r32f) restrict writeonly uniform image2D opaque_distance;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(opaque_distance);
    if (any(greaterThanEqual(pixel, size))) return;
    vec3 view = view_ray(frame.params, vec2(pixel) + 0.5, vec2(size));
    float h = camera_altitude(air.params, frame.params);
    bool ground = hits_ground(air.params, h, view.y);
    imageStore(opaque_distance, pixel, vec4(ground ? distance_to_ground(air.params, h, view.y) : 1e30));
}
