// What every source produces and every later stage reads. Twin: src/shared.rs.
#ifndef COMMON_PARTICLE
#define COMMON_PARTICLE

struct Particle {
    vec3  centre;     // [m], relative to the floating origin
    float density;    // relative density rho [1]; extinction = sigma_t · density · fade · profile
    vec4  rotation;   // unit quaternion (x, y, z, w), local → world
    vec3  semi_axes;  // [m]
    float fade;       // cross-fade between levels of detail [0, 1]
    vec3  colour;     // constant radiance C of `flat` lighting
    uint  id;         // stable identity, also the seed of everything random about it
};

// Light that reaches a particle; shares of the sunlight at the pole facing the sun, the centre and the far pole.
struct ParticleLight {
    vec3  diffuse;    // of what the particle itself scatters many times [0, 1]
    float ambient;    // visibility of the sky [0, 1]
    vec3  direct;     // of what comes straight from the sun [0, 1]
    float crowd;      // how much it sees of what its neighbours scatter: 0 alone, 1 in the depth of a crowd
    vec4  others;     // what it sees of it as the eye looks through it, per irradiance of the sun: gradient [1/(m sr)], value at
                      // the floating origin [1/sr]; of visible particles, and where the volume is fitted (lighting/tables/diffusion/params.glsl)
};

// Rotates v by the unit quaternion q.
vec3 rotate(vec4 q, vec3 v) {
    vec3 t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

// Rotates v by the inverse of the unit quaternion q.
vec3 rotate_inverse(vec4 q, vec3 v) {
    return rotate(vec4(-q.xyz, q.w), v);
}

// World → unit ball: positions (w = 1) or directions (w = 0) with the particle's ellipsoid mapped to the unit sphere.
// Lengths along a ray keep their parameter: a point at distance t [m] stays at parameter t.
vec3 to_unit_ball(Particle p, vec4 v) {
    return rotate_inverse(p.rotation, v.xyz - v.w * p.centre) / p.semi_axes;
}

#endif
