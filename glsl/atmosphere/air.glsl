// Clear air: geometry of a spherical planet, density profiles, coefficients and phase functions.
//
// A point is given by its altitude h [m] above sea level, never by its radius: at r = 6.36e6 m a float resolves only
// half a metre, and every difference of squares below is factored so that it does not cancel.
// A direction is given by mu, the cosine of its angle to the local vertical (+1 = straight up).
#ifndef ATMOSPHERE_AIR_GLSL
#define ATMOSPHERE_AIR_GLSL

#include "atmosphere/params.glsl"

const float AIR_PI = 3.14159265358979;

float safe_sqrt(float x) { return sqrt(max(x, 0.0)); }

// --- geometry -------------------------------------------------------------------------------------------------------

// Distance from a point at altitude h to the horizon, sqrt(r² − R²) [m].
float horizon_distance(AirParams air, float h) { return safe_sqrt(h * (2.0 * air.bottom_radius + h)); }

// Cosine of the direction that just grazes the sea-level sphere.
float horizon_mu(AirParams air, float h) { return -horizon_distance(air, h) / (air.bottom_radius + h); }

// Does the ray from h along mu meet the ground?
bool hits_ground(AirParams air, float h, float mu) { return mu < horizon_mu(air, h); }

// Distance along a ray to the top of the atmosphere [m], from a point inside it; the farther root of the sphere.
//   d = −rμ + sqrt((rμ)² + R_top² − r²), written without cancellation for either sign of mu.
float distance_to_top(AirParams air, float h, float mu) {
    float gap = (air.top_height - h) * (2.0 * air.bottom_radius + air.top_height + h); // R_top² − r²
    float b = (air.bottom_radius + h) * mu;
    float root = safe_sqrt(b * b + gap);
    return max(mu < 0.0 ? root - b : gap / max(root + b, 1e-3), 0.0);
}

// Distance along a ray that meets the ground [m]; the nearer root of the sphere.
float distance_to_ground(AirParams air, float h, float mu) {
    float rho = horizon_distance(air, h);
    float b = -(air.bottom_radius + h) * mu;
    return rho * rho / max(b + safe_sqrt((b - rho) * (b + rho)), 1e-3);
}

// Altitude a distance d along the ray [m]: h + (r_d² − r²)/(r_d + r).
float altitude_along(AirParams air, float h, float mu, float d) {
    float r = air.bottom_radius + h;
    float growth = d * (2.0 * r * mu + d); // r_d² − r²
    float r_d = safe_sqrt(r * r + growth);
    return h + growth / (r_d + r);
}

// Cosine of a direction's angle to the local vertical, a distance d along the ray. mu_other is the cosine at the
// start, nu the cosine between ray and direction; for the ray's own direction pass mu and 1.
float mu_along(AirParams air, float h, float mu_other, float nu, float h_d, float d) {
    return clamp(((air.bottom_radius + h) * mu_other + d * nu) / (air.bottom_radius + h_d), -1.0, 1.0);
}

// Where a ray runs below altitude `base`, before it meets the ground: from x to y [m]; y <= x if nowhere.
vec2 stretch_below(AirParams air, float h, float mu, float base) {
    float r = air.bottom_radius + h;
    float b = -r * mu;
    float gap = (base - h) * (2.0 * air.bottom_radius + base + h); // R_base² − r²
    vec2 stretch;
    if (gap >= 0.0) {
        float root = sqrt(b * b + gap);
        stretch = vec2(0.0, b > 0.0 ? b + root : gap / max(root - b, 1e-3));
    } else {
        float square = b * b + gap;
        if (b <= 0.0 || square <= 0.0) return vec2(0.0);
        float root = sqrt(square);
        stretch = vec2(-gap / (b + root), b + root);
    }
    if (hits_ground(air, h, mu)) stretch.y = min(stretch.y, distance_to_ground(air, h, mu));
    return stretch;
}

// --- medium ---------------------------------------------------------------------------------------------------------

struct AirSample {
    vec3 rayleigh;   // scattering [1/m]
    vec3 mie;        // scattering [1/m]
    vec3 extinction; // of all constituents [1/m]
};

AirSample air_at(AirParams air, float h) {
    h = max(h, 0.0);
    float rayleigh_density = exp(-h / air.rayleigh_scale_height);
    float mie_density = exp(-h / air.mie_scale_height);
    float ozone_density = max(0.0, 1.0 - abs(h - air.ozone_centre) / air.ozone_half_width);
    AirSample s;
    s.rayleigh = air.rayleigh_scattering * rayleigh_density;
    s.mie = air.mie_scattering * mie_density;
    s.extinction = s.rayleigh + air.mie_extinction * mie_density + air.ozone_absorption * ozone_density;
    return s;
}

// Phase functions [1/sr] of nu, the cosine between the view ray and the direction to the sun (+1 = looking at it).
float rayleigh_phase(float nu) { return 3.0 / (16.0 * AIR_PI) * (1.0 + nu * nu); }

// Cornette–Shanks.
float mie_phase(float nu, float g) {
    float k = 3.0 / (8.0 * AIR_PI) * (1.0 - g * g) / (2.0 + g * g);
    float base = max(1.0 + g * g - 2.0 * g * nu, 1e-6);
    return k * (1.0 + nu * nu) / (base * sqrt(base));
}

// Radiance gathered over one homogeneous step of length d from in-scattering j [1/m · W m⁻² sr⁻¹], in closed form:
//   ∫₀^d j e^(−σx) dx = j (1 − e^(−σd))/σ.  Below σd = 1e-3 the numerator cancels in f32; the series does not.
vec3 step_radiance(vec3 j, vec3 sigma_t, float d) {
    vec3 tau = sigma_t * d;
    vec3 small = d * (1.0 - tau * (0.5 - tau / 6.0));
    vec3 full = (1.0 - exp(-tau)) / max(sigma_t, vec3(1e-12));
    return j * mix(full, small, lessThan(tau, vec3(1e-3)));
}

// Part of the sun's disc above the geometric horizon [1]; the edge of the disc is a smoothstep (Bruneton 2017).
float sun_visible_fraction(AirParams air, float h, float mu_s) {
    float edge = air.sun_angular_radius * air.bottom_radius / (air.bottom_radius + h);
    return smoothstep(-edge, edge, mu_s - horizon_mu(air, h));
}

#endif
