// Phase functions: the probability per steradian [1/sr] that a scattering event turns light by a given angle.
//
// Orientation, here and everywhere: cos_theta = -dot(to_light, to_eye), so +1 is forward (light goes straight on into
// the eye) and -1 is backward. Both functions integrate to 1 over the sphere. CPU twin: src/reference/phase.rs.
#ifndef WELKIN_MEDIUM_PHASE_GLSL
#define WELKIN_MEDIUM_PHASE_GLSL

const float INV_FOUR_PI = 0.07957747154594767;

// Values of a `phase_function` parameter or specialization constant.
const uint PHASE_CORNETTE_SHANKS = 0u;
const uint PHASE_HENYEY_GREENSTEIN = 1u;

// Henyey–Greenstein, mean cosine g.
float phase_henyey_greenstein(float cos_theta, float g) {
    float d = 1.0 + g * g - 2.0 * g * cos_theta;
    return INV_FOUR_PI * (1.0 - g * g) / (d * sqrt(d));
}

// Cornette–Shanks (Yusov, Eq. 7); tends to Rayleigh's function as g → 0.
// Its mean cosine is 3 g (4 + g²) / (5 (2 + g²)), a little above g/2 · (…): 0.9 gives 0.925, 0.7 gives 0.757.
float phase_cornette_shanks(float cos_theta, float g) {
    float d = 1.0 + g * g - 2.0 * g * cos_theta;
    return INV_FOUR_PI * 1.5 * (1.0 - g * g) / (2.0 + g * g) * (1.0 + cos_theta * cos_theta) / (d * sqrt(d));
}

float phase(float cos_theta, float g, uint phase_function) {
    return phase_function == PHASE_HENYEY_GREENSTEIN ? phase_henyey_greenstein(cos_theta, g)
                                                     : phase_cornette_shanks(cos_theta, g);
}

#endif
