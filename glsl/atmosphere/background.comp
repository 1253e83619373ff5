#version 460
#extension GL_GOOGLE_include_directive : require
// What is behind the clouds, at full resolution: sky, sun and ground with the air in front of them. Linear radiance.
#include "atmosphere/ground.glsl"
#include "atmosphere/shafts.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, std430) restrict readonly buffer Air { AirParams params; } air;
layout(binding = 1, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 2, std430) restrict readonly buffer Light { SkyLight params; } sky_light;
layout(binding = 3) uniform sampler2D transmittance_lut;
layout(binding = 4) uniform sampler2D sky_view_smooth;
layout(binding = 5) uniform sampler2D sky_view_aerosol;
layout(binding = 6) uniform sampler2D cloud_shadow; // share of sunlight that the clouds let through to the ground
layout(binding = 7) uniform sampler2D below_smooth_table;
layout(binding = 8) uniform sampler2D below_aerosol_table;
layout(binding = 9) uniform sampler2D visibility;    // low resolution, of the sun along the ray below the clouds
layout(binding = 10) restrict writeonly uniform image2D radiance;
layout(push_constant) uniform BackgroundPush {
    vec2 shadow_centre;  // of the shadow map's square, relative to the floating origin [m]
    float shadow_extent; // half its side [m]; 0: no shadows
    float reserved;
} push;

// Sun's transmittance of the clouds at a place on the ground; the map fades out at its border.
float cloud_shadow_at(vec2 p) {
    if (push.shadow_extent <= 0.0) return 1.0;
    vec2 u = shadow_map_from_offset(p - push.shadow_centre, push.shadow_extent);
    float inside = 1.0 - smoothstep(0.85, 1.0, max(abs(u.x), abs(u.y)));
    return inside <= 0.0 ? 1.0 : mix(1.0, textureLod(cloud_shadow, 0.5 + 0.5 * u, 0.0).r, inside);
}

vec3 ground_behind(float h, vec3 view, float pixel_angle) {
    float t = distance_to_ground(air.params, h, view.y);
    vec2 p = frame.params.camera.xz + t * view.xz;
    float mu_down = -mu_along(air.params, h, view.y, 1.0, 0.0, t); // cosine of incidence of the view
    float footprint = t * pixel_angle / max(mu_down, 1e-3);
    vec3 albedo = ground_albedo(air.params.ground_albedo, ground_position(frame.params.origin, p), footprint);
    float nu = dot(view, frame.params.to_sun);
    float mu_s = mu_along(air.params, h, frame.params.to_sun.y, nu, 0.0, t);
    vec3 sun = air.params.solar_irradiance * transmittance_to_sun(transmittance_lut, air.params, 0.0, mu_s);
    vec3 ground = ground_radiance(albedo, sun, mu_s, cloud_shadow_at(p), sky_light.params.sky_irradiance_ground);
    return ground * transmittance_to_ground(transmittance_lut, air.params, h, view.y, t)
        + sky_radiance(sky_view_smooth, sky_view_aerosol, air.params, h, view, frame.params.to_sun);
}

vec3 sky_behind(float h, vec3 view, float pixel_angle) {
    vec3 sky = sky_radiance(sky_view_smooth, sky_view_aerosol, air.params, h, view, frame.params.to_sun);
    vec3 disc = sun_disc_radiance(air.params, view, frame.params.to_sun, pixel_angle);
    return sky + (disc.x > 0.0 ? disc * transmittance_to_top(transmittance_lut, air.params, h, view.y) : vec3(0.0));
}

// The view ray tilted so that its elevation is `elevation` [rad].
vec3 at_elevation(vec3 view, float elevation) {
    float s = max(length(view.xz), 1e-6);
    return vec3(view.x / s * cos(elevation), sin(elevation), view.z / s * cos(elevation));
}

// Sky or ground; a pixel that the horizon crosses gets both by coverage.
vec3 background(vec3 view) {
    float h = camera_altitude(air.params, frame.params);
    float pixel_angle = 2.0 * frame.params.tan_half_fov_y / float(frame.params.height);
    float horizon = asin(horizon_mu(air.params, h));
    float sky_part = clamp((asin(clamp(view.y, -1.0, 1.0)) - horizon) / pixel_angle + 0.5, 0.0, 1.0);
    vec3 sum = vec3(0.0);
    if (sky_part > 0.0) {
        vec3 sky_ray = sky_part < 1.0 ? at_elevation(view, horizon + 0.25 * pixel_angle) : view;
        sum += sky_part * sky_behind(h, sky_ray, pixel_angle);
    }
    if (sky_part < 1.0) {
        vec3 ground_ray = sky_part > 0.0 ? at_elevation(view, horizon - 0.25 * pixel_angle) : view;
        sum += (1.0 - sky_part) * ground_behind(h, ground_ray, pixel_angle);
    }
    return sum;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(radiance);
    if (any(greaterThanEqual(pixel, size))) return;
    vec3 view = view_ray(frame.params, vec2(pixel) + 0.5, vec2(size));
    vec3 light = background(view);
    float seen = shaft_visibility_at(visibility, (vec2(pixel) + 0.5) / vec2(size));
    light -= shaft_loss(below_smooth_table, below_aerosol_table, air.params, camera_altitude(air.params, frame.params),
                        view, frame.params.to_sun, seen);
    imageStore(radiance, pixel, vec4(max(light, 0.0), 1.0));
}
