// Extinction of a particle at a point of space: what `voxelize` samples and path tracing flies through. In space the
// unit ball is shrunk along the direction n = p_us / |p_us| of each point, to r(n) = 1 - depth(ellipsoid's point at n), and
// the profile with it: the particle is star-shaped. Along a ray the renderer shrinks it to r in one direction, near to where
// the ray meets the surface (blend/segment.glsl). Every style but the homogeneous one is displaced. CPU twin: src/reference/extinction.rs.
#ifndef DENSITY_EXTINCTION
#define DENSITY_EXTINCTION
#include "common/particle.glsl"
#include "detail/displace.glsl"
#include "lut/profile.glsl"

// Detail takes at most this much of the radius (as in blend/segment.glsl).
const float EXTINCTION_DEEPEST = 0.6;

// The radius r(n) that detail leaves of the unit ball in the unit direction n. `origin` anchors the noise to the world [m];
// `detail` is its strength, 0 turns it off; `footprint`: width of the finest thing to be resolved [m], above 0.
float displaced_radius(Particle p, vec3 n, vec3 origin, sampler3D detail_tile, float detail, float footprint) {
    if (detail <= 0.0) return 1.0;
    vec3 surface = p.centre + rotate(p.rotation, n * p.semi_axes) + origin;
    float size = min(p.semi_axes.x, min(p.semi_axes.y, p.semi_axes.z));
    float depth = surface_detail(detail_tile, surface, size, footprint).depth;
    return 1.0 - min(detail * depth / size, EXTINCTION_DEEPEST);
}

// Profile 0..1 of particle p at p_us (in its unit ball): its extinction there is sigma_t · density · fade · this.
float displaced_profile(Particle p, vec3 p_us, vec3 origin, sampler3D detail_tile, float detail, float footprint, uint style,
                        uint seed) {
    float r2 = dot(p_us, p_us);
    if (r2 >= 1.0) return 0.0;
    if (style == PROFILE_HOMOGENEOUS) return 1.0;
    vec3 n = r2 > 1e-12 ? p_us * inversesqrt(r2) : vec3(0.0, 1.0, 0.0);
    float radius = displaced_radius(p, n, origin, detail_tile, detail, footprint);
    return r2 < radius * radius ? profile_density(p_us / radius, style, seed) : 0.0;
}

#endif
