// Light that has been scattered more than once, in two streams along the sun's ray. CPU twin: src/reference/attenuation.rs.
#ifndef WELKIN_ATTENUATION_STREAMS
#define WELKIN_ATTENUATION_STREAMS

// Share of diffuse light that a layer of optical depth τ lets through, where nothing is absorbed: 1 / (1 + ¾ (1 - g) τ).
float streams_transmittance(float tau, float g) {
    return 1.0 / (1.0 + 0.75 * (1.0 - g) * tau);
}

// Mean radiance per irradiance of the sun [1/sr], `tau` deep in a layer of optical depth `column` in all. Where nothing is
// absorbed, the streams' difference is the same everywhere, T = 1 / (1 + γ column), γ = ¾ (1 - g), and their sum falls evenly
// from 1 + R to T:
//     F↓ + F↑ = (1 + 2 γ (column - τ)) T
// Each is spread over a half-sphere, hence a fluence of 2 (F↓ + F↑). The part of F↓ that has not been scattered yet, by the
// similarity relation exp(-(1 - g) τ), is none of it. What leaves through a cloud's sides is not known.
float streams_radiance(float tau, float column, float g) {
    float gamma = 0.75 * (1.0 - g);
    float streams = (1.0 + 2.0 * gamma * (column - tau)) / (1.0 + gamma * column);
    return 2.0 * max(streams - exp(-(1.0 - g) * tau), 0.0) * 0.07957747154594767;   // / 4π
}

#endif
