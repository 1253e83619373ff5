// Rays against ellipsoids, and the screen bounds of an ellipsoid.
#ifndef BLEND_ELLIPSOID
#define BLEND_ELLIPSOID
#include "common/frame.glsl"
#include "common/particle.glsl"

// A ray in the unit ball of a particle. Distances t along the world ray and positions in the ball go together as
// closest + (t - t_closest) · dir_us / metres.
struct BallRay {
    vec3  closest;     // point nearest to the centre
    vec3  dir_us;      // unit direction
    float metres;      // world length of one unit of the ball along this ray [m]
    float t_closest;   // [m]
    float b2;          // |closest|²: the ray hits where it is below 1
};

// The point of closest approach is found first: the textbook discriminant cancels when the eye is thousands of radii away.
BallRay ball_ray(Particle p, vec3 origin, vec3 dir) {
    vec3 o = to_unit_ball(p, vec4(origin, 1.0));
    vec3 d = to_unit_ball(p, vec4(dir, 0.0));
    float inverse = inversesqrt(dot(d, d));
    BallRay r;
    r.dir_us = d * inverse;
    r.metres = inverse;
    float along = dot(o, r.dir_us);
    r.closest = o - along * r.dir_us;
    r.t_closest = -along * inverse;
    r.b2 = dot(r.closest, r.closest);
    return r;
}

// Bounds (left, bottom, right, top) of the ellipsoid in normalised device coordinates with y upwards; the whole screen
// if it reaches behind the eye, nothing (left > right) if all of it is there.
// The silhouette is the conic dual to D = c cᵀ - S (c: centre, S: shape matrix, in view space): its extent in x solves
// D33 x² - 2 D13 x + D11 = 0. The discriminant is expanded, since D13² - D11 D33 cancels far away.
vec4 screen_bounds(FrameParams frame, Particle p) {
    vec3 relative = p.centre - frame.camera;
    vec3 c = vec3(dot(relative, frame.right), dot(relative, frame.up), dot(relative, frame.forward));
    vec3 ax = rotate_inverse(p.rotation, frame.right) * p.semi_axes;
    vec3 ay = rotate_inverse(p.rotation, frame.up) * p.semi_axes;
    vec3 az = rotate_inverse(p.rotation, frame.forward) * p.semi_axes;
    float sxx = dot(ax, ax), syy = dot(ay, ay), szz = dot(az, az), sxz = dot(ax, az), syz = dot(ay, az);
    float reach = sqrt(szz);
    if (c.z + reach <= 0.0) return vec4(1.0, 1.0, -1.0, -1.0);
    if (c.z - reach <= 1e-3 * reach) return vec4(-1.0, -1.0, 1.0, 1.0);
    float d33 = c.z * c.z - szz;
    vec2 middle = vec2(c.x * c.z - sxz, c.y * c.z - syz);
    vec2 discriminant = vec2(c.z * c.z * sxx - 2.0 * c.x * c.z * sxz + c.x * c.x * szz + (sxz * sxz - sxx * szz),
                             c.z * c.z * syy - 2.0 * c.y * c.z * syz + c.y * c.y * szz + (syz * syz - syy * szz));
    vec2 half_size = sqrt(max(discriminant, 0.0));
    vec2 scale = 1.0 / (d33 * frame.tan_half_fov_y * vec2(frame.aspect, 1.0));
    // A thousandth of slack covers the rounding of the bounds, and a sixteenth of a pixel the grid that corners are snapped
    // to (Vulkan asks for 4 bits below the pixel, and SwiftShader has no more); the fragments decide exactly.
    vec2 slack = 1e-3 * half_size * scale + 0.125 / vec2(frame.low_width, frame.low_height);
    vec4 bounds = vec4((middle - half_size) * scale - slack, (middle + half_size) * scale + slack);
    return clamp(bounds, vec4(-1.0), vec4(1.0));
}

#endif
