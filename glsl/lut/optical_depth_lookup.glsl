// The optical depth table (Yusov 4.1): for every ray that pierces the unit ball of the reference particle
//   x: mean normalised extinction along the chord, 0..1 (1 = the particle's full extinction all the way through)
//   y: distance from the entry point to the first matter, as a fraction of the chord (1 = the ray meets none).
// Optical depth of the ray = x · sigma_t · density · chord, so it scales with size and density.
//
// Coordinates: entry point S on the unit sphere by azimuth phi_s and zenith theta_s (about +y), and the direction in
// the tangent frame of S (local z points to the centre) by azimuth phi_v and zenith theta_v in [0, π/2].
// Layout of the 3D image: x = phi_s (wraps), y = theta_v · N_theta_s + theta_s, z = phi_v (wraps). Azimuths sit on texel
// centres i + ½; zeniths place their two ends on the first and the last texel centre. The sampler repeats and filters
// linearly: a look-up is two filtered fetches, and the interpolation over theta_v is done by hand.
// Filled by optical_depth.comp, which uses the inverse below; CPU twin: src/lut/axes.rs.
#ifndef WELKIN_LUT_OPTICAL_DEPTH_LOOKUP_GLSL
#define WELKIN_LUT_OPTICAL_DEPTH_LOOKUP_GLSL

const float LUT_PI = 3.14159265358979;

// Ratio of the two zenith resolutions' product to the image height is fixed: N_theta_v = N_theta_s.
// atan(y, x) of GLSL is undefined at the origin; there every azimuth is right.
float lut_azimuth(float y, float x) {
    return abs(x) + abs(y) < 1e-12 ? 0.0 : atan(y, x);
}

// Unit vectors of growing theta and growing phi at a direction with zenith theta about +y and azimuth phi (x → z).
void lut_tangent_frame(float theta, float phi, out vec3 point, out vec3 e_theta, out vec3 e_phi) {
    float st = sin(theta), ct = cos(theta), sp = sin(phi), cp = cos(phi);
    point = vec3(st * cp, ct, st * sp);
    e_theta = vec3(ct * cp, -st, ct * sp);
    e_phi = vec3(-sp, 0.0, cp);
}

// entry_us: where the ray enters the unit ball, |entry_us| = 1; dir_us: its direction, unit length, pointing inwards.
vec2 optical_depth_lookup(sampler3D lut, vec3 entry_us, vec3 dir_us) {
    float theta_s = acos(clamp(entry_us.y, -1.0, 1.0));
    float phi_s = lut_azimuth(entry_us.z, entry_us.x);
    vec3 point, e_theta, e_phi;
    lut_tangent_frame(theta_s, phi_s, point, e_theta, e_phi);
    float theta_v = acos(clamp(-dot(dir_us, entry_us), 0.0, 1.0));
    float phi_v = lut_azimuth(dot(dir_us, e_phi), dot(dir_us, e_theta));

    vec3 size = vec3(textureSize(lut, 0));
    float n_theta = sqrt(size.y);                                // N_theta_s = N_theta_v (32)
    float slice = theta_v * (2.0 / LUT_PI) * (n_theta - 1.0);
    float lower = min(floor(slice), n_theta - 2.0);
    float row = clamp(theta_s / LUT_PI, 0.0, 1.0) * (n_theta - 1.0) + 0.5;
    vec3 uvw = vec3(phi_s / (2.0 * LUT_PI), (lower * n_theta + row) / size.y, phi_v / (2.0 * LUT_PI));
    vec2 a = textureLod(lut, uvw, 0.0).xy;
    uvw.y += n_theta / size.y;
    vec2 b = textureLod(lut, uvw, 0.0).xy;
    return mix(a, b, slice - lower);
}

#endif
