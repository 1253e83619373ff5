// What the clouds are made of. Twin: src/blend/medium.rs.
#ifndef WELKIN_MEDIUM_PARAMS
#define WELKIN_MEDIUM_PARAMS

struct MediumParams {
    float g_single;         // asymmetry of the event that meets the sun
    uint  phase_function;   // PHASE_*
    float albedo;           // single-scattering albedo
    float crease;           // strength of the crease term [1]
    float detail;           // strength of the detail noise [1]; 0 turns it off
    float relief;           // how much of the noise's slope turns the surface for lighting [1]
    float reserved_a;
    float reserved_b;
};

#endif
