// The scattering tables of the homogeneous sphere (Yusov 4.2, 4.3), lit by a parallel beam of unit irradiance.
//
// One RG image holds both: x = single, y = multiple (2 and more) scattering, each divided by 1 - exp(-tau), where tau is
// the optical depth of the ray's chord. That quotient is the mean source function seen along the ray (the colour C of
// the compositing stages): it stays finite and smooth where the chord shrinks to nothing, and a look-up multiplies back.
// Single scattering varies faster than 32 x 64 x 16 texels can tell (its edge of shadow is 1/R wide), so the table holds
// what `single_scattering_model`, three closed-form steps along the ray, leaves over; interpolated, the sum is within
// 1.6 % RMS of the quadrature for random rays at any optical radius (docs/tables.md). Multiple scattering is stored as a
// multiple of a model of its own.
//
// A ray is described as the eye sees it, because the functions are smooth in these coordinates and the forward peak then
// lies along one axis:
//   Theta  scattering angle, cos Theta = -dot(to_sun, to_eye), 0 = looking into the sun, [0, π], dense at 0 (∝ t²);
//   psi    azimuth, about the ray, between the side of the sphere on which the ray runs and the sun, [0, π] by symmetry;
//   mu     cosine of the zenith angle of the ray at its entry point; the chord is 2 mu radii, b = sqrt(1 - mu²) is the
//          impact parameter. Below mu = 0.75 placed by the chord's optical depth, evenly to 50 and geometrically beyond,
//          so that grazing rays of thick spheres are resolved; above evenly in b;
//   R      optical radius sigma_t · density · radius, evenly in log2.
// Layout of the 3D image: x = Theta, y = psi, z = level · N_mu + mu; domain ends on texel centres.
// Below the range the table continues as R → 0 demands (∝ R); above it the table is constant.
// CPU twin of the mappings: src/lut/axes.rs.
#ifndef WELKIN_LUT_SCATTERING_LOOKUP_GLSL
#define WELKIN_LUT_SCATTERING_LOOKUP_GLSL

// Shared with src/lut/axes.rs (asserted equal by tests/tables.rs).
const float SCATTERING_LEVELS = 29.0;
const float SCATTERING_R_MIN = 0.4;     // optical radius of level 0
const float SCATTERING_R_MAX = 102.4;   // optical radius of the last level
const float SCATTERING_MU_SCALE = 50.0; // optical depth up to which chords are spaced evenly (tuned)
const float SCATTERING_MU_SPLIT = 0.75; // mu where even impact parameters begin, and the share of the axis below it

// (Theta, psi, mu) of a ray.
vec3 scattering_coordinates(vec3 entry_us, vec3 dir_us, vec3 to_sun_us) {
    float mu = clamp(-dot(entry_us, dir_us), 0.0, 1.0);
    float cos_theta = clamp(dot(to_sun_us, dir_us), -1.0, 1.0);
    // atan2 keeps the small angles of the forward direction that acos would lose.
    float theta = atan(length(cross(to_sun_us, dir_us)), cos_theta);
    vec3 side = entry_us + mu * dir_us;                     // centre → ray, at the closest point
    vec3 sun = to_sun_us - cos_theta * dir_us;
    float y = length(cross(side, sun)), x = dot(side, sun);
    float psi = abs(x) + y < 1e-12 ? 0.0 : atan(y, x);
    return vec3(theta, psi, mu);
}

// 1 - exp(-tau), without cancellation for thin media.
float scattering_opacity(float tau) {
    return tau < 1e-2 ? tau * (1.0 - tau * (0.5 - tau * (1.0 / 6.0))) : 1.0 - exp(-tau);
}

// (1 - exp(-x)) / x for x of either sign.
float scattering_mean_decay(float x) {
    return abs(x) < 1e-2 ? 1.0 - x * (0.5 - x * (1.0 / 6.0)) : (1.0 - exp(-x)) / x;
}

// Mean source function of single scattering, nearly: the chord is cut in three, the depth towards the sun is taken as
// linear on each piece (through two points of it), and the integral of Eq. 9 is then exact.
float single_scattering_model(vec3 entry_us, vec3 dir_us, vec3 to_sun_us, float mu, float optical_radius) {
    const float INSET = 0.1;                                 // the two points, from either end of a piece (tuned)
    const float SCALE = 0.5;                                 // optical depth up to which pieces are even (tuned)
    float tau = 2.0 * optical_radius * mu;
    if (tau < 1e-4) return 1.0;
    // Ends of the pieces: SCALE · sinh(k/3 · asinh(tau / SCALE)).
    float f = tau / SCALE;
    float e = pow(f + sqrt(f * f + 1.0), 1.0 / 3.0);
    float ends[4] = float[](0.0, 0.5 * SCALE * (e - 1.0 / e), 0.5 * SCALE * (e * e - 1.0 / (e * e)), tau);
    float along_sun = dot(entry_us, to_sun_us), along_dir = dot(dir_us, to_sun_us);
    float sum = 0.0;
    for (int k = 0; k < 3; ++k) {
        float t0 = ends[k], width = ends[k + 1] - t0;
        // Optical depth towards the sun from entry + s dir: R (sqrt(b² + 1 - |p|²) - b), b = p · to_sun.
        vec2 s = vec2(t0 + INSET * width, t0 + (1.0 - INSET) * width) / optical_radius;
        vec2 b = along_sun + s * along_dir;
        vec2 inside = max(s * (2.0 * mu - s), 0.0);          // 1 - |p|²
        vec2 q = optical_radius * (sqrt(b * b + inside) - b);
        float slope = (q.y - q.x) * (1.0 / (1.0 - 2.0 * INSET));
        float start = max(t0 + q.x - INSET * slope, 0.0);
        sum += exp(-start) * width * scattering_mean_decay(width + slope);
    }
    return sum / scattering_opacity(tau);
}

// What the mean source function of multiple scattering is nearly proportional to: R / (R + 2), a peak forward, and the
// harmonic mean of the cosines at which sunlight falls in and light leaves, c mu / (c + mu / 4), with the terminator blunted
// as far as the sun shines past the horizon into an optical depth of about one along the ray. The table holds the quotient,
// which texels can follow across a thick sphere, crescent and terminator included. The albedo scales it, and bends it little.
// (All numbers tuned: least interpolation error over media and optical radii.)
float multiple_scattering_model(vec3 entry_us, vec3 dir_us, vec3 to_sun_us, float mu, float optical_radius) {
    float cos_sun = dot(entry_us, to_sun_us), thin = 1.0 / optical_radius;
    float lit = cos_sun + sqrt(cos_sun * cos_sun + thin * (1.6 * thin + 0.4 * mu));
    float peak = inversesqrt(1.1 - dot(dir_us, to_sun_us)), sum = lit + 0.5 * mu + 0.005;
    return (0.1 * sum + lit * (mu + 0.035) * peak * peak * peak) / (sum * (1.0 + 2.0 * thin));
}

// What the table holds at one level: single scattering less its model [1], multiple scattering over its model [1/sr].
vec2 scattering_level_fetch(sampler3D lut, vec3 coordinates, float optical_radius, float level, vec3 size) {
    float n_mu = size.z / SCATTERING_LEVELS;
    float full = 2.0 * SCATTERING_MU_SPLIT / SCATTERING_MU_SCALE * optical_radius, mu = coordinates.z;
    float t_mu = mu <= SCATTERING_MU_SPLIT
        ? SCATTERING_MU_SPLIT * asinh(full / SCATTERING_MU_SPLIT * mu) / asinh(full)
        : 1.0 - 0.3779644730092272 * sqrt(max(1.0 - mu * mu, 0.0)); // 0.25 / b at the split
    vec3 t = vec3(sqrt(coordinates.x * 0.3183098861837907), coordinates.y * 0.3183098861837907, t_mu);
    vec3 texel = clamp(t, 0.0, 1.0) * (vec3(size.xy, n_mu) - 1.0) + 0.5;
    texel.z += level * n_mu;
    return textureLod(lut, texel / size, 0.0).xy;
}

// x: mean source function of single scattering, without the phase function; y: of multiple scattering [1/sr].
vec2 scattering_source_lookup(sampler3D lut, vec3 entry_us, vec3 dir_us, vec3 to_sun_us, float optical_radius) {
    vec3 size = vec3(textureSize(lut, 0));
    vec3 coordinates = scattering_coordinates(entry_us, dir_us, to_sun_us);
    float r = clamp(optical_radius, SCATTERING_R_MIN, SCATTERING_R_MAX);
    float level = log2(r / SCATTERING_R_MIN) * ((SCATTERING_LEVELS - 1.0) / log2(SCATTERING_R_MAX / SCATTERING_R_MIN));
    float lower = clamp(floor(level), 0.0, SCATTERING_LEVELS - 2.0);
    vec2 a = scattering_level_fetch(lut, coordinates, r, lower, size);
    vec2 b = scattering_level_fetch(lut, coordinates, r, lower + 1.0, size);
    vec2 source = mix(a, b, level - lower);
    float below = min(optical_radius / SCATTERING_R_MIN, 1.0);
    float single = single_scattering_model(entry_us, dir_us, to_sun_us, coordinates.z, optical_radius) + below * source.x;
    float multiple = below * multiple_scattering_model(entry_us, dir_us, to_sun_us, coordinates.z, r) * source.y;
    return max(vec2(single, multiple), 0.0);
}

// Single scattering (Yusov, Eq. 9) of the ray [1]: multiply by phase function and irradiance for radiance.
float single_scattering_lookup(sampler3D lut, vec3 entry_us, vec3 dir_us, vec3 to_sun_us, float optical_radius) {
    float tau = 2.0 * optical_radius * max(-dot(entry_us, dir_us), 0.0);
    return scattering_source_lookup(lut, entry_us, dir_us, to_sun_us, optical_radius).x * scattering_opacity(tau);
}

// Radiance of light scattered twice or more, for unit irradiance [1/sr].
float multiple_scattering_lookup(sampler3D lut, vec3 entry_us, vec3 dir_us, vec3 to_sun_us, float optical_radius) {
    float tau = 2.0 * optical_radius * max(-dot(entry_us, dir_us), 0.0);
    return scattering_source_lookup(lut, entry_us, dir_us, to_sun_us, optical_radius).y * scattering_opacity(tau);
}

#endif
