// What the clear air is made of, and the light it gives: twins of `AirParams` and `SkyLight` in src/atmosphere/air.rs.
#ifndef ATMOSPHERE_PARAMS_GLSL
#define ATMOSPHERE_PARAMS_GLSL

// Three wavelengths (680, 550, 440 nm) stand for linear sRGB. Irradiance is in W m⁻² nm⁻¹.
struct AirParams {
    vec3 rayleigh_scattering;    // at sea level [1/m]
    float rayleigh_scale_height; // [m]
    vec3 mie_scattering;         // of the aerosol at sea level [1/m]
    float mie_scale_height;      // [m]
    vec3 mie_extinction;         // of the aerosol at sea level [1/m]
    float mie_g;                 // asymmetry of its Cornette–Shanks phase function [1]
    vec3 ozone_absorption;       // at the layer's centre [1/m]
    float ozone_centre;          // altitude [m]
    vec3 solar_irradiance;       // outside the atmosphere, facing the sun [W m⁻² nm⁻¹]
    float ozone_half_width;      // from the layer's centre to zero [m]
    vec3 ground_albedo;          // diffuse, as the air sees it from afar [1]
    float bottom_radius;         // of the planet at sea level [m]
    float top_height;            // altitude above which there is no air [m]
    float sun_angular_radius;    // [rad]
    float reserved_a;
    float reserved_b;
};

struct SkyLight {
    vec3 sun_irradiance_clouds;    // of the sun, on a plane facing it, at the clouds' altitude
    float reserved_a;
    vec3 sky_irradiance_clouds;    // of the sky above, on a horizontal plane facing up, at the clouds' altitude
    float reserved_b;
    vec3 ground_irradiance_clouds; // of ground and air below, on a horizontal plane facing down, at the clouds' altitude
    float reserved_c;
    vec3 sun_irradiance_ground;    // of the sun, on a plane facing it, at sea level
    float reserved_d;
    vec3 sky_irradiance_ground;    // of the sky, on a horizontal plane facing up, at sea level
    float reserved_e;
};

#endif
