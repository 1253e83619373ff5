// Sampling of directions. CPU twin: src/reference/phase.rs.
#ifndef PATHTRACE_SCATTER
#define PATHTRACE_SCATTER
#include "medium/phase.glsl"

// Cosine of an angle distributed by Henyey and Greenstein's function (exact inversion).
float sample_henyey_greenstein(float g, float u) {
    if (abs(g) < 1e-3) return 1.0 - 2.0 * u;
    float q = (1.0 - g * g) / (1.0 - g + 2.0 * g * u);
    return clamp((1.0 + g * g - q * q) / (2.0 * g), -1.0, 1.0);
}

// An orthonormal basis about unit n (Duff et al., "Building an Orthonormal Basis, Revisited", 2017).
void basis_about(vec3 n, out vec3 a, out vec3 b) {
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float c = -1.0 / (s + n.z), d = n.x * n.y * c;
    a = vec3(1.0 + s * n.x * n.x * c, s * d, -s * n.x);
    b = vec3(d, s + n.y * n.y * c, -n.y);
}

// n turned by an angle of the given versine, 1 - cos, about an azimuth of u turns.
vec3 turned(vec3 n, float versine, float u) {
    vec3 a, b;
    basis_about(n, a, b);
    float sine = sqrt(max(versine * (2.0 - versine), 0.0)), azimuth = 6.283185307179586 * u;
    return normalize((1.0 - versine) * n + sine * (cos(azimuth) * a + sin(azimuth) * b));
}

#endif
