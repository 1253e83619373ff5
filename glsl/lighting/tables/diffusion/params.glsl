// Nested boxes of voxels around the camera, in which the sunlight that the clouds scatter is let diffuse.
// Written by the host (src/lighting/volume.rs).
#ifndef WELKIN_VOLUME_PARAMS
#define WELKIN_VOLUME_PARAMS

const uint VOLUME_LEVELS = 8u;

struct VolumeParams {
    vec3  to_sun;            // unit, towards the light
    float base;              // height of the lower faces at `bend` [m, floating origin]
    vec2  bend;              // around this point (x, z) the boxes follow the planet's curvature [m, floating origin]
    float inverse_diameter;  // 1 / (2 · planet radius) [1/m]; 0 is a flat world
    float height;            // of a voxel of the two finest levels [m]; it doubles from each other level to the next
    uint  levels;            // 0: there is no volume
    uint  dim;               // voxels along either horizontal edge of a level
    uint  layers;            // of voxels, of all levels together
    float extinction;        // mean of a whole ellipsoid of relative density 1, detail taken off [1/m]
    float albedo;            // single-scattering albedo
    float asymmetry;         // mean cosine of scattering
    float shade;             // optical depth over what light lists count, which know ellipsoids without detail
    float body;              // radius, in a particle's, of the ball that holds its matter once detail is taken off [1]
    float vacuum;            // what fills empty space: see diffusion/start.comp [1/m]
    uint  fitted;            // 1: particles are smaller than voxels, and each has a linear fit of what it sees (lighting/tables/diffusion/seen.comp)
    float reserved_a;
    float reserved_b;
    vec4  corner[VOLUME_LEVELS]; // least x, least z [m, floating origin]; edge of a voxel [m]; 1 / edge
    ivec4 stack[VOLUME_LEVELS];  // x, z of the voxel in which the next finer level begins, which covers dim / 2; first layer in
                                 // the stack of all levels, layers
};

// Extinctions are summed as integers, in any order to the same sum.
const float VOLUME_UNITS = 1048576.0;   // per 1/m

#endif
