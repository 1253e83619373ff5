// How sunlight fares among particles. CPU twin: src/reference/lighting.rs.
#ifndef WELKIN_LIGHTING_TRANSFER
#define WELKIN_LIGHTING_TRANSFER

const uint TRANSFER_DIFFUSION = 0u;
const uint TRANSFER_EXPONENTIAL = 1u;   // Yusov 5.3: exp(-ξ τ) dims all of it

// What sunlight is left, at points with `tau` of other particles in front.
struct SunShares {
    vec3  diffuse;   // of what the particle itself scatters many times
    float gathered;  // radiance that its neighbours lend it, per irradiance of the sun [1/sr]
    vec3  direct;    // of what comes straight from the sun
};

// Fitted to path-traced heaps and skies (docs/accuracy.md).
const float CROWD_LEAK = 2.55;      // light that a particle loses to its neighbours, which look no brighter for it
const float CROWD_RETURN = 3.6;     // and that comes back where the crowd is deep on all sides
const float GATHERED = 0.13;        // [1/sr]

// tau: optical depths of the other particles in front of the pole facing the sun, the centre and the far pole; own: of
// this one, from pole to pole; xi: `clouds.xi`.
//
// Diffusion. Light that is scattered without loss fades in a cloud as 1 / (1 + c τ), c = 3/4 (1 - g) for a layer
// (Bohren 1987), not exponentially. Two things are different in a heap of particles. Where they overlap, the optical
// depth on a particle's axis is that of the crowded inside, while the eye sees the outside of the crowd: on the lit side τ
// counts per particle of the crowd, on the far side less so. And light passes between the members of a crowd: what one
// gathers from the others comes from many sides and is flat, with none of the shading of a ball in the sun. Alone
// (τ = 0) the particle keeps all its light, and the tables hold.
SunShares sun_shares(vec3 tau, float own, float xi, uint transfer) {
    if (transfer == TRANSFER_EXPONENTIAL) {
        vec3 share = exp(-xi * tau);
        return SunShares(share, 0.0, share);
    }
    float crowd = 1.0 + max(tau.z - tau.x, 0.0) / max(own, 1e-3);
    float others = 1.0 - 1.0 / crowd;
    float kept = 1.0 - CROWD_LEAK * others + CROWD_RETURN * others * others;
    float root = sqrt(crowd);
    vec3 shared_by = vec3(crowd * root, crowd, root);
    return SunShares(kept / (1.0 + xi * tau / shared_by), GATHERED * others / (1.0 + 2.0 * xi * tau.y), exp(-tau));
}

#endif
