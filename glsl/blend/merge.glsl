// Volume-aware blending (Yusov 5.5, Eq. 10-17): how the segments that particles cut out of a view ray are combined.
// No bindings in here: the blend modes, their resolves and the tests' probe all call the same functions.
#ifndef BLEND_MERGE
#define BLEND_MERGE

// A stretch of a ray through one homogeneous medium.
struct Segment {
    vec3  colour;         // C = L_in / (1 - T): radiance of the stretch if it were opaque
    float optical_depth;  // of the whole stretch [1]; 0 = there is none
    float t_enter;        // distance along the unit ray [m]
    float t_exit;
};

// What lies behind the pending segment, already composited.
struct Committed {
    vec3  radiance;       // in-scattered radiance L_in that reaches its front
    float optical_depth;  // Σ tau of every segment merged so far, the pending one included: T = exp(-Σ tau) exactly
};

const Segment NO_SEGMENT = Segment(vec3(0.0), 0.0, 3.0e38, 3.0e38);

// 1 - exp(-tau) without cancellation: below 1e-2 the series is exact to f32.
float opacity(float tau) {
    return tau < 1e-2 ? tau * (1.0 - tau * (0.5 - tau * (1.0 / 6.0 - tau / 24.0))) : 1.0 - exp(-tau);
}

// C (1 - T) + T L_B (Eq. 8, 13): a stretch in front of what has been committed.
vec3 over(vec3 colour, float tau, vec3 behind) {
    return colour * opacity(tau) + exp(-tau) * behind;
}

// Optical depth of the part [a, b] of a homogeneous segment.
float part_optical_depth(Segment s, float a, float b) {
    return s.optical_depth * clamp((b - a) / max(s.t_exit - s.t_enter, 1e-6), 0.0, 1.0);
}

// Merges `incoming` into the pending segment of a pixel, drawn back to front; what lies behind both is committed.
// Exact for two segments; with more, the pending one is taken as homogeneous (K = 1, the paper's merge).
void merge(inout Segment pending, inout Committed committed, Segment incoming) {
    if (incoming.optical_depth <= 0.0) return;
    committed.optical_depth += incoming.optical_depth;
    if (pending.optical_depth <= 0.0) {
        pending = incoming;
        return;
    }
    bool incoming_first = incoming.t_enter <= pending.t_enter;
    Segment near = pending, far = incoming;
    if (incoming_first) { near = incoming; far = pending; }

    if (near.t_exit <= far.t_enter) {                       // Disjoint: the farther one is done.
        committed.radiance = over(far.colour, far.optical_depth, committed.radiance);
        pending = near;
        return;
    }

    // Front [near.t_enter, far.t_enter] belongs to `near`; the back to whichever reaches farther (containment too).
    float t_overlap = min(near.t_exit, far.t_exit);
    Segment last = near;
    if (far.t_exit > near.t_exit) last = far;
    float tau_back = part_optical_depth(last, t_overlap, last.t_exit);
    committed.radiance = over(last.colour, tau_back, committed.radiance);                      // Eq. 12, 13

    float tau_near = part_optical_depth(near, far.t_enter, t_overlap);
    float tau_far  = part_optical_depth(far, far.t_enter, t_overlap);
    float tau_both = tau_near + tau_far;
    vec3 mixed = (near.colour * tau_near + far.colour * tau_far) / max(tau_both, 1e-37);       // Eq. 15
    float tau_front = part_optical_depth(near, near.t_enter, far.t_enter);
    float tau = tau_front + tau_both;
    vec3 radiance = over(near.colour, tau_front, mixed * opacity(tau_both));                   // Eq. 11, 14, 17
    // Back to non-premultiplied. As tau → 0 the quotient tends to the mean weighted by optical depth.
    vec3 colour = tau > 1e-6 ? radiance / opacity(tau)
                             : (near.colour * tau_front + mixed * tau_both) / max(tau, 1e-37);
    pending = Segment(colour, tau, near.t_enter, t_overlap);
}

// In-scattered radiance of everything merged, seen from in front of the pending segment.
vec3 resolve_radiance(Segment pending, Committed committed) {
    return over(pending.colour, pending.optical_depth, committed.radiance);
}

#endif
