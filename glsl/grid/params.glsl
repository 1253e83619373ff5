// What the grid stages need of a frame. Written by the host (src/grid/params.rs).
#ifndef WELKIN_GRID_PARAMS
#define WELKIN_GRID_PARAMS
#include "density/field.glsl"

const uint RING_CAPACITY = 8u;
const uint THRESHOLDS = 65u; // knots of the coverage → threshold curve

struct GridParams {
    ivec4 ring_first[RING_CAPACITY]; // xy: absolute index (x, z) of the ring's first cell; z: layers at full thickness; w: position steps per cell edge
    vec4 ring_frame[RING_CAPACITY];  // xy: corner of that cell [m, floating origin]; z: cell edge [m]; w: 1 / edge
    vec4 ring_layer[RING_CAPACITY];  // x: layer step [m]; y: 1 / step; z: share of fine detail that cells resolve; w: unused
    vec4 threshold[17];              // field value above which a share i/64 of the world lies, four to a vector
    vec4 lean[4];                    // how far columns lean at even heights from base to top, x and z, two to a vector [m]
    vec3 camera;                     // camera [m, floating origin]
    float altitude;                  // cloud base above sea level [m]
    float thickness;                 // highest column [m]
    float inverse_cutoff_squared;    // [1/m²]
    float inverse_diameter;          // 1 / (2 · planet radius) [1/m]; 0 is a flat world
    float coverage;                  // share of the area that is covered, 0..1
    int frequency_heap;              // of the noises, 2^-32 lattice cells per position step
    int frequency_billow;
    int frequency_turret;
    int frequency_streak;
    int frequency_region;
    int frequency_map_along;         // texels of the coverage image per position step, 2^-32, × cosine of its rotation
    int frequency_map_across;        // the same × sine
    int map_centre_x;                // position step of the coverage image's centre
    int map_centre_z;
    uint map_width;                  // 0: no coverage image
    uint map_height;
    uint ring_count;
    uint ring_dim;                   // cells along a ring's edge
    uint seed;
    uint particle_capacity;
    uint valid_cell_capacity;
    float density;                   // relative density of a full particle [1]
    uint phase;                      // of the noises, 2^-24 lives: density/field.glsl
    uint weather_phase;
    uint evolving;                   // 1: columns grow and dissolve, and so must without a jump
    uint lean_count;                 // heights that have a lean; 0: upright
    uint reserved_a;
    uint reserved_b;
    uint reserved_c;
};

FieldFrequencies field_frequencies(GridParams p) {
    return FieldFrequencies(p.frequency_heap, p.frequency_billow, p.frequency_turret, p.frequency_streak,
                            p.frequency_region, p.phase, p.weather_phase);
}

#endif
