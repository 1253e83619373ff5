// Where each quantity sits in its table: exact inverse pairs between physical coordinates and [0, 1], and between
// [0, 1] and texture coordinates. Ends of a domain lie on texel centres, so a look-up there does not interpolate.
#ifndef ATMOSPHERE_MAPPING_GLSL
#define ATMOSPHERE_MAPPING_GLSL

#include "atmosphere/air.glsl"

// [0, 1] → texture coordinate, and texel index → [0, 1].
float to_texture(float x, int size) { return 0.5 / float(size) + x * (1.0 - 1.0 / float(size)); }
float from_texel(int i, int size) { return float(i) / float(size - 1); }

// --- transmittance to the top of the atmosphere, by (mu, h) (Bruneton 2008) -------------------------------------------
// Only rays that miss the ground are stored: x runs over the distance to the top, from straight up to the horizon.
vec2 transmittance_from_ray(AirParams air, float h, float mu) {
    float top = horizon_distance(air, air.top_height);
    float rho = horizon_distance(air, h);
    float d_min = air.top_height - h;
    float d_max = rho + top;
    float d = distance_to_top(air, h, max(mu, horizon_mu(air, h)));
    return vec2(clamp((d - d_min) / (d_max - d_min), 0.0, 1.0), rho / top);
}

// x = h, y = mu.
vec2 ray_from_transmittance(AirParams air, vec2 u) {
    float top = horizon_distance(air, air.top_height);
    float rho = top * u.y;
    float h = rho * rho / (air.bottom_radius + sqrt(air.bottom_radius * air.bottom_radius + rho * rho));
    float d_min = air.top_height - h;
    float d = d_min + u.x * (rho + top - d_min);
    float gap = (air.top_height - h) * (2.0 * air.bottom_radius + air.top_height + h); // R_top² − r²
    float mu = d <= 0.0 ? 1.0 : (gap - d * d) / (2.0 * (air.bottom_radius + h) * d);
    return vec2(h, clamp(mu, -1.0, 1.0));
}

// --- multiple scattering by (mu_s, h) (Hillaire 2020) -----------------------------------------------------------------
// Both axes are warped by a square root: most happens near the ground and when the sun is near the horizon.
vec2 multiple_from_point(AirParams air, float h, float mu_s) {
    float x = 0.5 + 0.5 * sign(mu_s) * sqrt(abs(mu_s));
    return vec2(x, sqrt(clamp(h / air.top_height, 0.0, 1.0)));
}

// x = h, y = mu_s.
vec2 point_from_multiple(AirParams air, vec2 u) {
    float s = 2.0 * u.x - 1.0;
    return vec2(air.top_height * u.y * u.y, s * abs(s));
}

// --- sky view by (azimuth, elevation), for the camera's altitude --------------------------------------------------------
// x: azimuth from the sun, 0 to pi (the sky is symmetric about the sun's vertical plane); linear, because the sharp
//    aureole is not stored (its phase function is applied after the look-up).
// y: angle from the horizon of the sea-level sphere, by its square root. The upper half of the rows is sky, the lower
//    half ground, and no look-up interpolates across: the length of the ray jumps there.
vec2 sky_view_from_direction(AirParams air, float h, float mu, float azimuth) {
    float above = asin(clamp(mu, -1.0, 1.0)) - asin(horizon_mu(air, h)); // angle above the horizon [rad]
    float dip = -asin(horizon_mu(air, h));
    bool ground = hits_ground(air, h, mu);
    float span = ground ? 0.5 * AIR_PI - dip : 0.5 * AIR_PI + dip;
    float s = sqrt(clamp(abs(above) / span, 0.0, 1.0));
    return vec2(azimuth / AIR_PI, ground ? -s : s);
}

// x = mu, y = azimuth; u.y from -1 (nadir) to +1 (zenith), ground = whether the row belongs to the lower half.
vec2 direction_from_sky_view(AirParams air, float h, vec2 u, bool ground) {
    float dip = -asin(horizon_mu(air, h));
    float span = ground ? 0.5 * AIR_PI - dip : 0.5 * AIR_PI + dip;
    float above = u.y * abs(u.y) * span;
    float mu = sin(above - dip);
    float grazing = horizon_mu(air, h); // rounding must not move a row to the other side
    mu = ground ? min(mu, grazing - 1e-7) : max(mu, grazing);
    return vec2(mu, u.x * AIR_PI);
}

// Texture coordinate of a sky-view value: rows [0, n/2) are ground, nadir first; rows [n/2, n) sky, zenith last.
vec2 sky_view_texture(vec2 u, bool ground, ivec2 size) {
    int half_rows = size.y / 2;
    float row = ground ? (1.0 + u.y) * float(half_rows - 1) : float(half_rows) + u.y * float(half_rows - 1);
    return vec2(to_texture(u.x, size.x), (row + 0.5) / float(size.y));
}

// The value's [0, 1] × [-1, 1] coordinate of a texel.
vec2 sky_view_texel(ivec2 texel, ivec2 size) {
    int half_rows = size.y / 2;
    bool ground = texel.y < half_rows;
    float y = ground ? float(texel.y) / float(half_rows - 1) - 1.0
                     : float(texel.y - half_rows) / float(half_rows - 1);
    return vec2(from_texel(texel.x, size.x), y);
}

// --- aerial perspective by (azimuth, elevation, distance), for the camera's altitude --------------------------------------
// x: azimuth as above. y: elevation, both ends and the horizontal on texel centres (odd number of rows), by its
// square root. z: distance by its square root. Rays do not stop at the ground, so nothing jumps at the horizon.
vec3 aerial_from_ray(float mu, float azimuth, float distance, float distance_max) {
    float e = asin(clamp(mu, -1.0, 1.0)) / (0.5 * AIR_PI);
    float y = 0.5 + 0.5 * sign(e) * sqrt(abs(e));
    return vec3(azimuth / AIR_PI, y, sqrt(clamp(distance / distance_max, 0.0, 1.0)));
}

// x = mu, y = azimuth, z = distance.
vec3 ray_from_aerial(vec3 u, float distance_max) {
    float s = 2.0 * u.y - 1.0;
    return vec3(sin(0.5 * AIR_PI * s * abs(s)), u.x * AIR_PI, distance_max * u.z * u.z);
}

// Cosine between view and sun from their cosines to the vertical and the azimuth between them.
float nu_from_azimuth(float mu, float mu_s, float azimuth) {
    float s = safe_sqrt((1.0 - mu) * (1.0 + mu)) * safe_sqrt((1.0 - mu_s) * (1.0 + mu_s));
    return clamp(mu * mu_s + s * cos(azimuth), -1.0, 1.0);
}

// Azimuth [rad], 0 to pi, of a view direction from the sun's (both unit, +y up). At the zenith, where it does not
// matter, it is 0.
float azimuth_from_sun(vec3 view, vec3 to_sun) {
    vec2 v = view.xz, s = to_sun.xz;
    float cross_term = abs(v.x * s.y - v.y * s.x), dot_term = dot(v, s);
    return cross_term + abs(dot_term) < 1e-9 ? 0.0 : atan(cross_term, dot_term);
}

#endif
