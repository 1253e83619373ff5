#version 460
#extension GL_GOOGLE_include_directive : require
// Air between the camera and a distance, by (azimuth, elevation, distance): mean in-scattering per unit of solar
// irradiance and kilometre (as two parts, like the sky view), and mean extinction [1/km] by (elevation, distance).
// Means instead of sums: they hardly change with distance, so interpolation between distances is nearly exact.
// Every frame. One invocation walks one column. Cost: 2 steps a texel.
#include "atmosphere/sky.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, std430) restrict readonly buffer Air { AirParams params; } air;
layout(binding = 1, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 2) uniform sampler2D transmittance_lut;
layout(binding = 3) uniform sampler2D multiple_lut;
layout(binding = 4, rgba16f) restrict writeonly uniform image3D smooth_table;
layout(binding = 5, rgba16f) restrict writeonly uniform image3D aerosol_table;
layout(binding = 6, rgba16f) restrict writeonly uniform image2D extinction_table;

void store(ivec3 texel, Airlight light, float distance_km) {
    imageStore(smooth_table, texel, vec4(light.smooth_part / distance_km, 1.0));
    imageStore(aerosol_table, texel, vec4(light.aerosol / distance_km, 1.0));
    if (texel.x == 0) imageStore(extinction_table, texel.yz, vec4(light.optical_depth / distance_km, 1.0));
}

void main() {
    ivec2 column = ivec2(gl_GlobalInvocationID.xy);
    ivec3 size = imageSize(smooth_table);
    if (any(greaterThanEqual(column, size.xy))) return;
    float h = camera_altitude(air.params, frame.params), mu_s = frame.params.to_sun.y;
    vec2 u = vec2(from_texel(column.x, size.x), from_texel(column.y, size.y));
    vec2 direction = ray_from_aerial(vec3(u, 0.0), AERIAL_DISTANCE_MAX).xy;
    float nu = nu_from_azimuth(direction.x, mu_s, direction.y);

    Airlight light = Airlight(vec3(0.0), vec3(0.0), vec3(0.0));
    step_airlight(transmittance_lut, multiple_lut, air.params, h, direction.x, mu_s, nu, 0.0, 1.0, light);
    store(ivec3(column, 0), light, 1e-3); // the limit at distance 0: one metre's worth
    light = Airlight(vec3(0.0), vec3(0.0), vec3(0.0));
    float begin = 0.0;
    for (int z = 1; z < size.z; ++z) {
        float end = ray_from_aerial(vec3(u, from_texel(z, size.z)), AERIAL_DISTANCE_MAX).z;
        for (int k = 0; k < AERIAL_STEPS; ++k) {
            float from = mix(begin, end, float(k) / float(AERIAL_STEPS));
            float to = mix(begin, end, float(k + 1) / float(AERIAL_STEPS));
            step_airlight(transmittance_lut, multiple_lut, air.params, h, direction.x, mu_s, nu, from, to, light);
        }
        store(ivec3(column, z), light, 1e-3 * end);
        begin = end;
    }
}
