#version 460
#extension GL_GOOGLE_include_directive : require
// Airlight along whole rays from the camera, by direction, per unit of solar irradiance: Rayleigh and multiple
// scattering [1/sr], and aerosol single scattering without its phase function [1]; and the share of it from the stretch
// below the clouds, which their shadows can take away. Every frame. Cost: 80 steps a texel.
#include "atmosphere/sky.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, std430) restrict readonly buffer Air { AirParams params; } air;
layout(binding = 1, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 2) uniform sampler2D transmittance_lut;
layout(binding = 3) uniform sampler2D multiple_lut;
layout(binding = 4, rgba16f) restrict writeonly uniform image2D smooth_table;
layout(binding = 5, rgba16f) restrict writeonly uniform image2D aerosol_table;
layout(binding = 6, rgba16f) restrict writeonly uniform image2D below_smooth_table;
layout(binding = 7, rgba16f) restrict writeonly uniform image2D below_aerosol_table;
layout(push_constant) uniform SkyViewPush {
    float cloud_base; // altitude [m]
} push;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(smooth_table);
    if (any(greaterThanEqual(texel, size))) return;
    float h = camera_altitude(air.params, frame.params);
    Airlight light = sky_view_value(transmittance_lut, multiple_lut, air.params, h, frame.params.to_sun.y, texel, size);
    Airlight below = sky_view_below(transmittance_lut, multiple_lut, air.params, h, frame.params.to_sun.y, push.cloud_base,
                                    texel, size);
    imageStore(below_smooth_table, texel, vec4(below.smooth_part, 1.0));
    imageStore(below_aerosol_table, texel, vec4(below.aerosol, 1.0));
    imageStore(smooth_table, texel, vec4(light.smooth_part, 1.0));
    imageStore(aerosol_table, texel, vec4(light.aerosol, 1.0));
}
