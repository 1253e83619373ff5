#version 460
#extension GL_GOOGLE_include_directive : require
// Mean visibility of the sun [1] along the stretch of each view ray below the clouds, at the cloud targets' resolution.
// Cost: 12 look-ups of the shadow map a texel.
#include "atmosphere/shafts.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, std430) restrict readonly buffer Air { AirParams params; } air;
layout(binding = 1, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 2) uniform sampler2D cloud_shadow;
layout(binding = 3, r16f) restrict writeonly uniform image2D visibility;
layout(push_constant) uniform ShaftsPush {
    vec2 shadow_centre;
    float shadow_extent; // [m]
    float cloud_base;    // altitude [m]
    uint downscale;
    uint reserved;
} push;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, imageSize(visibility)))) return;
    vec2 size = vec2(frame.params.width, frame.params.height);
    vec3 view = view_ray(frame.params, (vec2(texel) + 0.5) * float(push.downscale), size);
    float h = camera_altitude(air.params, frame.params);
    vec2 stretch = stretch_below(air.params, h, view.y, push.cloud_base);
    float seen = shaft_visibility(cloud_shadow, air.params, frame.params, push.shadow_centre, push.shadow_extent, h, view,
                                  stretch, shaft_shift(texel));
    imageStore(visibility, texel, vec4(seen));
}
