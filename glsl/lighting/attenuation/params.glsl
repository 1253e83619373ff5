// Boxes of voxels, stacked in one volume, one of whose axes runs along the light. Written by the host
// (src/lighting/attenuation/volume.rs).
#ifndef WELKIN_ATTENUATION_PARAMS
#define WELKIN_ATTENUATION_PARAMS

const uint ATTENUATION_LEVELS = 8u;

// Optical depths are summed as integers, so that their sum does not depend on the order of particles: of this many units.
const float ATTENUATION_UNITS = 65536.0;

struct AttenuationParams {
    vec3  to_sun;       // unit, towards the light
    float extinction;   // of a particle of relative density 1 [1/m]
    uint  levels;       // boxes in use, the finest first; 0: there is no volume
    uint  dim;          // voxels across the light
    uint  depth;        // voxels along it, of each level
    float body;         // radius, in a particle's, of the ellipsoid that dims
    vec3  anchor;       // in the middle of all boxes [m, floating origin]
    float asymmetry;    // mean cosine of scattering, of light that is scattered more than once
    // Point, from the anchor [m] → place in a level [voxels]: u and v across the light, w away from it.
    vec4  row_u[ATTENUATION_LEVELS];
    vec4  row_v[ATTENUATION_LEVELS];
    vec4  row_w[ATTENUATION_LEVELS];
};

#endif
