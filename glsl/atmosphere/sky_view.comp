#version 460
#extension GL_GOOGLE_include_directive : require
// Airlight along whole rays from the camera, by direction, per unit of solar irradiance: Rayleigh and multiple
// scattering [1/sr], and aerosol single scattering without its phase function [1]. Every frame. Cost: 40 steps a texel.
#include "atmosphere/sky.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, std430) restrict readonly buffer Air { AirParams params; } air;
layout(binding = 1, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 2) uniform sampler2D transmittance_lut;
layout(binding = 3) uniform sampler2D multiple_lut;
layout(binding = 4, rgba16f) restrict writeonly uniform image2D smooth_table;
layout(binding = 5, rgba16f) restrict writeonly uniform image2D aerosol_table;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(smooth_table);
    if (any(greaterThanEqual(texel, size))) return;
    float h = camera_altitude(air.params, frame.params);
    Airlight light = sky_view_value(transmittance_lut, multiple_lut, air.params, h, frame.params.to_sun.y, texel, size);
    imageStore(smooth_table, texel, vec4(light.smooth_part, 1.0));
    imageStore(aerosol_table, texel, vec4(light.aerosol, 1.0));
}
