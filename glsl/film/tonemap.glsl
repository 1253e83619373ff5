// Tone curve and transfer function. CPU twin: src/reference/film.rs.
#ifndef FILM_TONEMAP
#define FILM_TONEMAP

// Curve of Uchimura ("HDR theory and practice", 2017): toe, straight middle, shoulder to white, per channel, so that
// bright clouds roll off to neutral white.
const float MAXIMUM = 1.0;       // display white
const float CONTRAST = 1.05;     // slope of the straight part (tuned)
const float LINEAR_START = 0.20; // where the toe ends (tuned)
const float LINEAR_LENGTH = 0.42;// of the straight part (tuned)
const float TOE = 1.25;          // exponent of the toe: deepens the zenith (tuned)

float filmic(float x) {
    float shoulder_start = LINEAR_START + (MAXIMUM - LINEAR_START) * LINEAR_LENGTH / CONTRAST;
    float top = LINEAR_START + CONTRAST * ((MAXIMUM - LINEAR_START) * LINEAR_LENGTH / CONTRAST);
    float steepness = CONTRAST * MAXIMUM / (MAXIMUM - top);
    float toe = LINEAR_START * pow(x / LINEAR_START, TOE);
    float straight = LINEAR_START + CONTRAST * (x - LINEAR_START);
    float shoulder = MAXIMUM - (MAXIMUM - top) * exp(-steepness * (x - shoulder_start) / MAXIMUM);
    float in_toe = 1.0 - smoothstep(0.0, LINEAR_START, x);
    float in_shoulder = step(shoulder_start, x);
    return toe * in_toe + straight * (1.0 - in_toe - in_shoulder) + shoulder * in_shoulder;
}

// sRGB transfer function (IEC 61966-2-1).
float srgb_encode(float x) {
    return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1.0 / 2.4) - 0.055;
}

vec3 display_value(vec3 radiance, float exposure, uint curve) {
    vec3 x = max(radiance * exposure, 0.0);
    vec3 toned = curve == 0u ? vec3(filmic(x.r), filmic(x.g), filmic(x.b)) : min(x, 1.0);
    return vec3(srgb_encode(toned.r), srgb_encode(toned.g), srgb_encode(toned.b));
}

#endif
