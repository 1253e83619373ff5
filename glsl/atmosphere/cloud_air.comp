#version 460
#extension GL_GOOGLE_include_directive : require
// Puts the air in front of the clouds, at the resolution of the cloud targets: radiance is dimmed by the air up to the
// first cloud and gets the airlight of that stretch for the part of the pixel that the cloud covers,
//   L' = L · T_air(d) + (1 − T) · S(d).
// Done before upsampling, because L' and T may be interpolated across the edge of a cloud, but its distance may not.
#include "atmosphere/shafts.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, std430) restrict readonly buffer Air { AirParams params; } air;
layout(binding = 1, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 2) uniform sampler3D smooth_table;
layout(binding = 3) uniform sampler3D aerosol_table;
layout(binding = 4) uniform sampler2D extinction_table;
layout(binding = 5) uniform sampler2D cloud;   // radiance, transmittance
layout(binding = 6) uniform sampler2D nearest; // distance to the first cloud [m]
layout(binding = 7) uniform sampler2D visibility; // of the sun along the ray below the clouds
layout(binding = 8) uniform sampler2D below_smooth_table;
layout(binding = 9) uniform sampler2D below_aerosol_table;
layout(binding = 10) restrict writeonly uniform image2D cloud_in_air;
layout(push_constant) uniform CloudAirPush {
    float cloud_base; // altitude [m]
    uint downscale;
} push;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, imageSize(cloud_in_air)))) return;
    vec4 layer = texelFetch(cloud, texel, 0);
    float distance = texelFetch(nearest, texel, 0).r;
    if (distance < 1e29) {
        vec2 size = vec2(frame.params.width, frame.params.height);
        vec3 view = view_ray(frame.params, (vec2(texel) + 0.5) * float(push.downscale), size);
        AerialPerspective aerial = aerial_perspective(smooth_table, aerosol_table, extinction_table, air.params, distance,
                                                      view, frame.params.to_sun);
        float seen = shaft_visibility_at(visibility, (vec2(texel) + 0.5) / vec2(textureSize(visibility, 0)));
        float h = camera_altitude(air.params, frame.params);
        vec2 stretch = stretch_below(air.params, h, view.y, push.cloud_base);
        if (stretch.y > stretch.x) {
            // Clouds begin at their base, where the stretch ends; one that hangs lower hides the rest of it.
            float part = clamp((distance - stretch.x) / (stretch.y - stretch.x), 0.0, 1.0);
            aerial.inscatter -= part * shaft_loss(below_smooth_table, below_aerosol_table, air.params, h, view,
                                                  frame.params.to_sun, seen);
        }
        layer.rgb = layer.rgb * aerial.transmittance + (1.0 - layer.a) * aerial.inscatter;
    }
    imageStore(cloud_in_air, texel, layer);
}
