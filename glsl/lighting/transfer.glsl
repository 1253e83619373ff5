// How sunlight fares among particles. CPU twin: src/reference/lighting.rs.
#ifndef WELKIN_LIGHTING_TRANSFER
#define WELKIN_LIGHTING_TRANSFER

const uint TRANSFER_DIFFUSION = 0u;
const uint TRANSFER_EXPONENTIAL = 1u;   // Yusov 5.3: exp(-ξ τ) dims all of it

// What sunlight is left, at points with `tau` of other particles in front.
struct SunShares {
    vec3 diffuse;
    vec3 direct;
};

// Light that a particle in a crowd gets from its neighbours, at most, as share of its own (fitted to path-traced heaps).
const float GATHERED = 1.8;

// tau: optical depths of the other particles in front of the pole facing the sun, the centre and the far pole; own: of
// this one, from pole to pole; xi: `clouds.xi`.
//
// Diffusion. Light that is scattered without loss fades in a cloud as 1 / (1 + c τ), c = 3/4 (1 - g) for a layer
// (Bohren 1987), not exponentially. Two things are different in a heap of particles. Where they overlap, the optical
// depth on a particle's axis is that of the crowded inside, while the eye sees the outside of the crowd: on the lit side τ
// counts per particle of the crowd, on the far side less so. And what leaves the side of one particle of a crowd enters
// the next: it is brighter than alone. Alone (τ = 0) both are 1, and the tables hold.
SunShares sun_shares(vec3 tau, float own, float xi, uint transfer) {
    if (transfer == TRANSFER_EXPONENTIAL) {
        vec3 share = exp(-xi * tau);
        return SunShares(share, share);
    }
    float crowd = 1.0 + max(tau.z - tau.x, 0.0) / max(own, 1e-3);
    float others = 1.0 - 1.0 / crowd;
    float gathered = 1.0 + GATHERED * others * others;
    float root = sqrt(crowd);
    vec3 shared_by = vec3(crowd * root, crowd, root);
    return SunShares(gathered / (1.0 + xi * tau / shared_by), exp(-tau));
}

#endif
