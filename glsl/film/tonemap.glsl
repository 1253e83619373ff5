// Tone curve and transfer function. CPU twin: src/reference/film.rs.
#ifndef FILM_TONEMAP
#define FILM_TONEMAP

// Values of `curve`.
const uint CURVE_FILMIC = 0u;
const uint CURVE_LINEAR = 1u;   // values above 1 clip

// Toe and shoulder per channel, so that bright clouds roll off to neutral white and the toe deepens the zenith: a rational
// fit of the ACES reference curve (Narkowicz 2015). Of the curves tried (also Hable, AgX, Uchimura) it is the one that
// shows sunlit tops nearly white and the zenith deep blue at the same exposure.
float filmic(float x) {
    return clamp(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0);
}

// sRGB transfer function (IEC 61966-2-1).
float srgb_encode(float x) {
    return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1.0 / 2.4) - 0.055;
}

// Its inverse.
float srgb_decode(float x) {
    return x <= 0.04045 ? x / 12.92 : pow((x + 0.055) / 1.055, 2.4);
}

vec3 display_value(vec3 radiance, vec3 gain, uint curve) {
    vec3 x = max(radiance * gain, 0.0);
    vec3 toned = curve == CURVE_FILMIC ? vec3(filmic(x.r), filmic(x.g), filmic(x.b)) : min(x, 1.0);
    return vec3(srgb_encode(toned.r), srgb_encode(toned.g), srgb_encode(toned.b));
}

#endif
