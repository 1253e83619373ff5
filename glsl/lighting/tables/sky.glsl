// Share of the sky's light that reaches a particle.
#ifndef WELKIN_LIGHTING_SKY
#define WELKIN_LIGHTING_SKY

const uint NO_CELL = 0xffffffffu; // an explicit particle

// How open the sky is towards a neighbouring column whose top lies `above` the particle [m]. Diffuse light fades over
// some 450 m of cloud (tuned against photographs of cumulus; the mean free path for transport is about 100 m).
float sky_openness(float above) {
    return exp(-max(above, 0.0) / 450.0);
}

#endif
