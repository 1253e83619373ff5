// How sunlight fares among particles. CPU twin: src/reference/lighting.rs.
#ifndef WELKIN_LIGHTING_TRANSFER
#define WELKIN_LIGHTING_TRANSFER

const uint TRANSFER_DIFFUSION = 0u;
const uint TRANSFER_EXPONENTIAL = 1u;   // Yusov 5.3: exp(-ξ τ) dims all of it

// What sunlight is left, at points with `tau` of other particles in front.
struct SunShares {
    vec3  diffuse;   // of what the particle itself scatters many times
    float crowd;     // how much it sees of what its neighbours scatter: 0 alone, 1 in the depth of a crowd
    vec3  direct;    // of what comes straight from the sun
};

// tau: optical depths of the other particles in front of the pole facing the sun, the centre and the far pole; own: of
// this one, from pole to pole; xi: `clouds.xi`; voxel: edge of a voxel, in half chords of the particle along the light.
//
// Diffusion. What feeds a particle's own multiple scattering fades slowly, because light that has been scattered forward is
// still there. Light that its neighbours have scattered is in the volume (lighting/tables/diffusion/start.comp), and so is its own where voxels
// are much smaller than it. Alone (τ = 0) a particle of a list keeps all its light, gets none from others, and the tables hold.
SunShares sun_shares(vec3 tau, float own, float xi, float voxel, uint transfer) {
    vec3 fading = exp(-xi * tau);
    if (transfer == TRANSFER_EXPONENTIAL) return SunShares(fading, 0.0, fading);
    float behind = max(tau.z - tau.x, 0.0);
    float alone = own / max(behind + own, 1e-6);
    float alone2 = alone * alone, alone4 = alone2 * alone2;   // a few neighbours make a crowd
    // A particle smaller than a voxel is next to nothing of what is there, and sees it all.
    float large = min(1.0 / (voxel * voxel), 1.0);
    return SunShares(mix(min(voxel, 1.0), 1.0, alone4) * fading, 1.0 - large * alone4 * alone2, exp(-tau));
}

#endif
