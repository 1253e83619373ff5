// What the four passes of the multiple scattering solver share. One "job" is one total angular momentum j: the problem of
// the ball decouples into these (docs/tables.md). Each pass runs for many jobs at once, one in a workgroup.
//   transport_emit     sources on shells      → source at every point of every ray, in the frame of the ray
//   transport_sweep    source along rays      → radiance along rays, in place
//   transport_turn     radiance at shells     → in the frame of the radius
//   transport_project  over all directions    → moments, times albedo and phase function: the next source
// Oracle: src/reference/transport.rs, src/lut/transport/plan.rs.
#ifndef WELKIN_LUT_TRANSPORT_GLSL
#define WELKIN_LUT_TRANSPORT_GLSL

const uint TRANSPORT_ORDERS = 33u;   // largest l_max + 1
const uint TRANSPORT_BUCKET = 128u;  // most points in a bucket
const uint TRANSPORT_EACH = 4u;      // points that one invocation works on, so that what it reads of matrices serves all

struct TransportJob {
    uint j;          // total angular momentum
    uint source;     // first element of its source, [component][shell]
    uint field;      // first element of its field, [n][point]; n = j % 2 + 2 k is the order about the normal of the ray's plane
    uint order;      // first element of its radiance at the crossings, [m][crossing]
    uint rotation;   // first element of its rotation matrix, [k][m]
    uint components; // number of (l, m) with m <= j
};

struct TransportPoint {
    vec4 weights;    // of four consecutive shells
    float cos_alpha; // angle from the radius vector to the direction of travel
    float sin_alpha;
};

// Points that lie between the same shells, so that what they read of the sources is the same for a whole workgroup.
struct TransportBucket {
    uint start;      // first place in the order of points
    uint count;      // at most TRANSPORT_BUCKET
    uint shell;      // first of the four shells
    uint crossing;   // 1: the points lie on that shell itself
};

vec2 complex_multiply(vec2 a, vec2 b) {
    return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

#endif
