#version 460
// One level of the scattering table, a texel an invocation.
// Multiple: the harmonics of the sun's direction are summed on the radiance that leaves along the texel's ray.
// Single: Eq. 9 by Gauss–Legendre quadrature, less the closed-form model that look-ups add again (scattering_lookup.glsl).
// In: field of the view rays. Out: `table`, rg16f.
#extension GL_GOOGLE_include_directive : require
#include "lut/scattering_lookup.glsl"
#include "lut/transport.glsl"

layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer Rays { uvec2 at[]; } rays;              // first point, number of points
layout(binding = 1, std430) restrict readonly buffer Harmonics { vec2 at[]; } harmonics;     // [j, k][direction]
layout(binding = 2, std430) restrict readonly buffer Mus { float at[]; } mus;
layout(binding = 3, std430) restrict readonly buffer Field { vec2 at[]; } field;             // [j, k][point]
layout(binding = 4, rg16f) restrict writeonly uniform image3D table;
layout(push_constant) uniform ScatteringPush { uint point_count; uint terms; uint level; float optical_radius; };

// Nodes and weights of the 8-point Gauss–Legendre rule, positive half.
const vec4 GAUSS_X = vec4(0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363);
const vec4 GAUSS_W = vec4(0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763);

float depth_towards_sun(vec3 p, vec3 to_sun, float inside) {
    float b = dot(p, to_sun), root = sqrt(b * b + inside);
    return optical_radius * (b > 0.0 ? inside / (b + root) : root - b);
}

// ∫ e^(-τ) dτ over chord and towards the sun, cut geometrically towards both ends of the chord.
float single_scattering(vec3 entry, vec3 dir, vec3 to_sun, float mu) {
    float chord = 2.0 * mu;
    int half_pieces = 4 + int(ceil(log2(optical_radius * chord + 1.0)));
    float sum = 0.0, near = 0.0;
    for (int piece = 0; piece < half_pieces; ++piece) {
        float far = mu * exp2(float(piece + 1 - half_pieces));
        float middle = 0.5 * (near + far), half_width = 0.5 * (far - near);
        for (int i = 0; i < 16; ++i) {
            float x = GAUSS_X[(i >> 1) & 3] * ((i & 1) == 0 ? 1.0 : -1.0);
            float s = middle + half_width * x;
            if (i >= 8) s = chord - s;                       // the mirrored piece
            vec3 p = entry + s * dir;
            float q = depth_towards_sun(p, to_sun, s * (chord - s));
            sum += GAUSS_W[(i >> 1) & 3] * half_width * optical_radius * exp(-optical_radius * s - q);
        }
        near = far;
    }
    return sum;
}

void main() {
    ivec3 size = imageSize(table);
    uint directions = uint(size.x * size.y);
    uint direction = gl_GlobalInvocationID.x, view = gl_GlobalInvocationID.y;
    if (direction >= directions) return;

    // Multiple scattering.
    uint last = rays.at[view].x + rays.at[view].y - 1u;
    float radiance = 0.0;
    for (uint term = 0u; term < terms; ++term) {
        radiance += dot(harmonics.at[term * directions + direction], field.at[term * point_count + last]);
    }

    // Single scattering, on the ray of these coordinates (src/reference/sphere.rs, RayCoordinates::ray).
    ivec2 texel = ivec2(direction % uint(size.x), direction / uint(size.x));
    vec2 t = vec2(texel) / vec2(size.xy - 1);
    float theta = 3.14159265358979 * t.x * t.x, psi = 3.14159265358979 * t.y;
    float mu = max(mus.at[view], 1e-5);
    vec3 entry = vec3(sqrt(max(1.0 - mu * mu, 0.0)), 0.0, mu), dir = vec3(0.0, 0.0, -1.0);
    vec3 to_sun = vec3(sin(theta) * cos(psi), sin(theta) * sin(psi), -cos(theta));
    float opacity = scattering_opacity(2.0 * optical_radius * mu);
    float single = single_scattering(entry, dir, to_sun, mu) / opacity;
    float rest = single - single_scattering_model(entry, dir, to_sun, mu, optical_radius);

    float n_mu = float(size.z) / SCATTERING_LEVELS;
    ivec3 at = ivec3(texel, int(level * uint(n_mu) + view));
    float multiple = max(radiance, 0.0) / (opacity * multiple_scattering_model(entry, dir, to_sun, mu, optical_radius));
    imageStore(table, at, vec4(rest, multiple, 0.0, 0.0));
}
