// What a view ray meets of a particle: all that a lighting method may ask about the segment that it gives a source radiance.
//
// A method is a folder glsl/lighting/NAME. Its source.glsl declares what it reads, at bindings from 32 on, and
//     vec3 source_radiance(Hit hit)
// the mean source function of the segment: its colour C, radiance if it were opaque [W m⁻² sr⁻¹ nm⁻¹]. The build compiles
// every compositing shader once for each method; nothing else knows which there are.
#ifndef LIGHTING_HIT
#define LIGHTING_HIT
#include "blend/ellipsoid.glsl"

struct Hit {
    uint     index;          // of the particle
    Particle particle;
    BallRay  ray;
    vec3     dir;            // unit, away from the eye [world]
    vec3     normal_us;      // where on the unit ball the surface that light meets lies, turned by detail
    vec3     normal_ws;      // the surface's normal
    float    extinction;     // mean over the chord [1/m]
    float    t_enter;        // ends of what the eye sees of the chord [m]
    float    t_exit;
    float    chord_depth;    // optical depth of the whole chord, hidden parts included
    float    first_matter;   // how far below the ellipsoid matter begins [radii]
};

#endif
