// What a splat lets pass of the light through it. CPU twin: src/reference/forward.rs.
#ifndef LIGHTING_FORWARD_SPLAT
#define LIGHTING_FORWARD_SPLAT

const uint SPLAT_GAUSSIAN = 0u;
const uint SPLAT_POLYNOMIAL = 1u;

// 1 - w: how much less opaque the splat is than in its middle, q = f² from there, f = 1 at the rim.
// Four at a time. Gaussian: w = (e^(-2 q) - e^-2) / (1 - e^-2), the standard deviation at f = ½. Polynomial (Stoian 6): w = 2 f³ - 3 f² + 1.
vec4 splat_rest(vec4 q, uint profile) {
    vec4 f2 = min(q, vec4(1.0));
    return profile == SPLAT_POLYNOMIAL ? f2 * (3.0 - 2.0 * sqrt(f2)) : (1.0 - exp(-2.0 * f2)) * 1.15651764;
}

// One step of the recurrence I_k = g_(k-1) + T_(k-1) I_(k-1) (Harris, Eq. 4) over I_(k-1), for a splat of optical depth tau in
// its middle: T = 1 - w (1 - e^-tau), g = w (1 - e^-tau) forward I. A sum of positive terms: no digit is lost where little
// passes. `forward`: albedo times the share of scattered light that stays in the cone.
vec4 splat_passes(vec4 rest, float tau, float forward) {
    float clear = exp(-tau);
    return rest + (1.0 - rest) * (clear + forward * (1.0 - clear));
}

#endif
