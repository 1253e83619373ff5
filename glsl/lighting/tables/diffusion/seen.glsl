// How deep in a particle the light is that the eye sees.
#ifndef WELKIN_VOLUME_SEEN
#define WELKIN_VOLUME_SEEN
#include "lighting/tables/diffusion/params.glsl"

// Distance from the front of a particle of mean `extinction` [1/m] to where others' light is looked up [m]: most of a transport
// mean free path. That may be beyond the particle, for light of what stands behind goes through it nearly forward.
float seen_depth(float extinction) {
    return min(2.5 / extinction, 1.0 / volume.params.vacuum);
}

#endif
