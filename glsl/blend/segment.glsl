// The segment that a particle cuts out of the view ray of a pixel. Included after the bindings that it reads.
#include "volume/lookup.glsl"
#include "volume/seen.glsl"
layout(constant_id = 0) const uint LIGHTING = LIGHTING_TABLES;
layout(constant_id = 1) const uint HOMOGENEOUS = 0;   // 1: density 1 everywhere inside, no table and no detail

// Radius of the ball on which rays look their detail up. A smaller one draws truer silhouettes (relative RMSE of a heap's
// cover 0.30 at 1, 0.22 at 0.7, 0.17 at 0.6, 0.16 at 0.5) and smears the noise over more of the limb.
const float DETAIL_BALL = 0.6;

// `pixel`: centre of the pixel, as gl_FragCoord.xy has it.
Segment particle_segment(uint index, vec2 pixel) {
    FrameParams f = frame.params;
    Particle p = particles.elements[index];
    vec3 dir = view_ray(f, pixel, vec2(f.low_width, f.low_height));
    BallRay ray = ball_ray(p, f.camera, dir);
    if (ray.b2 >= 1.0) return NO_SEGMENT;

    float half_chord = sqrt(1.0 - ray.b2);
    float radius = 1.0;
    vec3 normal_shift = vec3(0.0);
    float depth = 0.0;
    if (HOMOGENEOUS == 0u && medium.params.detail > 0.0) {
        // The noise is that of the direction in which the ray meets the surface, which only the noise knows: a smaller ball
        // stands for it. Rays that miss that ball take the direction of their point nearest to the centre, as a
        // silhouette does (glsl/density/extinction.glsl has the body that this draws).
        float in_front = sqrt(max(DETAIL_BALL * DETAIL_BALL - ray.b2, 0.0));
        vec3 facing = normalize(ray.closest - in_front * ray.dir_us);
        vec3 position = p.centre + rotate(p.rotation, facing * p.semi_axes) + f.origin;
        float size = min(p.semi_axes.x, min(p.semi_axes.y, p.semi_axes.z));
        float t_surface = ray.t_closest - in_front * ray.metres;
        float footprint = max(t_surface, 0.0) * 2.0 * f.tan_half_fov_y / float(f.low_height);
        Detail d = surface_detail(detail_tile, position, size, footprint);
        depth = min(medium.params.detail * d.depth / size, 0.6);
        normal_shift = d.gradient * medium.params.detail * medium.params.relief;
        radius = 1.0 - depth;
        if (ray.b2 >= radius * radius) return NO_SEGMENT;
        half_chord = sqrt(radius * radius - ray.b2);
    }

    float t_enter = ray.t_closest - half_chord * ray.metres;
    float t_exit = ray.t_closest + half_chord * ray.metres;
    float t_opaque = texelFetch(opaque_distance, ivec2(pixel), 0).x;
    Segment s;
    s.t_enter = max(t_enter, 0.0);
    s.t_exit = min(t_exit, t_opaque);
    float length_inside = s.t_exit - s.t_enter;
    if (length_inside <= 0.0) return NO_SEGMENT;

    vec3 entry_us = (ray.closest - half_chord * ray.dir_us) / radius;
    vec2 matter = HOMOGENEOUS == 1u ? vec2(1.0, 0.0) : optical_depth_lookup(optical_depth_lut, entry_us, ray.dir_us);
    float sigma = f.sigma_t * p.density * p.fade * matter.x;
    s.optical_depth = sigma * length_inside;
    if (s.optical_depth <= 0.0) return NO_SEGMENT;

    if (LIGHTING == LIGHTING_FLAT) {
        s.colour = p.colour;
    } else {
        // The noise's slope turns the surface that light meets, but never away from the eye.
        vec3 normal_us = entry_us;
        float shift = length(normal_shift);
        if (shift > 0.0) {
            normal_us += rotate_inverse(p.rotation, normal_shift / (1.0 + shift));
            normal_us = normalize(normal_us - max(dot(normal_us, ray.dir_us) + 0.05, 0.0) * ray.dir_us);
        }
        vec3 normal_ws = normalize(rotate(p.rotation, normal_us / p.semi_axes));
        float tau_chord = sigma * (t_exit - t_enter);
        ParticleLight light = lights.elements[index];
        float others = 0.0;   // what others have scattered
        if (light.crowd > 0.0) {
            float seen = s.t_enter + seen_depth(sigma);
            if (volume.params.fitted == 1u) {
                // The fit holds near its middle (volume/seen.comp).
                float middle = ray.t_closest - ray.metres + seen_depth(f.sigma_t * p.density * p.fade * f.fill);
                seen = clamp(seen, middle - 0.25 * ray.metres, middle + 0.25 * ray.metres);
                others = max(dot(light.others.xyz, f.camera + seen * dir) + light.others.w, 0.0);
            } else {
                others = light.crowd * volume_radiance(light_volume, f.camera + seen * dir);
            }
        }
        s.colour = shade_tables(medium.params, sky_light.params, light, scattering_lut, f, p, ray, normal_us,
                                dir, normal_ws, tau_chord, matter.y + depth, others);
    }
    return s;
}
