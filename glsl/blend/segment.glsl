// The segment that a particle cuts out of the view ray of a pixel: exact optical depth and detail noise from here, its colour
// from the lighting method. Included after blend/bindings.glsl.
#include "lighting/hit.glsl"
#include "lighting/source.glsl"   // the build puts each method's own in its place
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
        vec3 position = p.centre + rotate(p.rotation, facing * p.semi_axes) + f.detail_origin;
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

    // The noise's slope turns the surface that light meets, but never away from the eye.
    vec3 normal_us = entry_us;
    float shift = length(normal_shift);
    if (shift > 0.0) {
        normal_us += rotate_inverse(p.rotation, normal_shift / (1.0 + shift));
        normal_us = normalize(normal_us - max(dot(normal_us, ray.dir_us) + 0.05, 0.0) * ray.dir_us);
    }
    Hit hit;
    hit.index = index;
    hit.particle = p;
    hit.ray = ray;
    hit.dir = dir;
    hit.normal_us = normal_us;
    hit.normal_ws = normalize(rotate(p.rotation, normal_us / p.semi_axes));
    hit.extinction = sigma;
    hit.t_enter = s.t_enter;
    hit.t_exit = s.t_exit;
    hit.chord_depth = sigma * (t_exit - t_enter);
    hit.first_matter = matter.y + depth;
    s.colour = source_radiance(hit);
    return s;
}
