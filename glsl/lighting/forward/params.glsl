// The lights of lighting `forward`. Twin: src/lighting/forward/mod.rs.
#ifndef LIGHTING_FORWARD_PARAMS
#define LIGHTING_FORWARD_PARAMS

const uint FORWARD_LIGHTS = 4u;

// Whose irradiance `colour` scales.
const uint FROM_SUN = 0u;
const uint FROM_SKY = 1u;
const uint FROM_OWN = 2u;

struct ForwardLight {
    vec3 to_light;     // unit
    uint from;         // FROM_*
    vec3 colour;       // share of that irradiance, or irradiance itself [W m⁻² nm⁻¹]
    uint reserved;
};

struct ForwardParams {
    uint  count;           // lights in use
    uint  phase_function;  // PHASE_*
    float g;               // its asymmetry
    float albedo;          // single-scattering albedo
    ForwardLight light[FORWARD_LIGHTS];
};

#endif
