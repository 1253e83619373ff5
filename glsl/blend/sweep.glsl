// The exact integral over any number of overlapping segments of a ray, front to back: between consecutive entries and
// exits the medium has sigma = Σ sigma_i and colour Σ sigma_i C_i / Σ sigma_i. CPU twin: src/reference/segments.rs.
//
// Events are taken in batches: one walk over the segments finds the next SWEEP_EVENTS event times, a second one adds each
// segment to the stretches between them that it covers. Sums only ever grow, so nothing cancels, and no store limits how
// many segments overlap. Both walks end at the first segment that begins behind the batch.
// Cost: a segment is visited twice for every batch that it reaches into or lies before.
//
// The includer defines a sequence of segments, ordered by `sweep_floor`:
//   bool    sweep_valid(uint cursor)                  whether the cursor stands at a segment
//   uint    sweep_next(uint cursor)
//   float   sweep_floor(uint cursor)                  neither this segment nor a later one begins before this distance [m]
//   Segment sweep_segment(uint cursor, bool shaded)   without `shaded`, the colour is not needed
#ifndef BLEND_SWEEP
#define BLEND_SWEEP
#include "blend/merge.glsl"

const uint  SWEEP_EVENTS = 8u;
const float SWEEP_NEVER = 3.0e38;

struct Sweep {
    vec3  radiance;        // in-scattered
    float optical_depth;   // of the whole ray
    float nearest;         // first entry [m]; 1e30 if there is none
};

// Keeps `t` if it is among the first SWEEP_EVENTS distinct times, ascending.
void sweep_insert(inout float times[SWEEP_EVENTS], float t) {
    [[unroll]] for (uint k = 0u; k < SWEEP_EVENTS; ++k) {
        if (t == times[k]) t = SWEEP_NEVER;
        float first = min(t, times[k]);
        t = max(t, times[k]);
        times[k] = first;
    }
}

// Integrates from the first segment on. Ends where less than `cutoff` of the light behind would come through.
Sweep sweep_from(uint first, float cutoff) {
    Sweep result = Sweep(vec3(0.0), 0.0, 1e30);
    float done = -1.0;   // Everything before is integrated; distances are positive.
    bool more = true;
    while (more) {
        float times[SWEEP_EVENTS];
        [[unroll]] for (uint k = 0u; k < SWEEP_EVENTS; ++k) times[k] = SWEEP_NEVER;
        bool all_past = true;
        for (uint c = first; sweep_valid(c) && sweep_floor(c) < times[SWEEP_EVENTS - 1u]; c = sweep_next(c)) {
            Segment s = sweep_segment(c, false);
            if (s.optical_depth > 0.0 && s.t_exit > done) {
                all_past = false;
                if (s.t_enter > done) sweep_insert(times, s.t_enter);
                sweep_insert(times, s.t_exit);
            } else if (all_past) {
                first = sweep_next(c);
            }
        }
        float end = times[SWEEP_EVENTS - 1u];
        more = end < SWEEP_NEVER;

        float sigma[SWEEP_EVENTS];     // Σ sigma_i of the stretch that ends at times[k] [1/m]
        vec3 weighted[SWEEP_EVENTS];   // Σ sigma_i C_i
        [[unroll]] for (uint k = 0u; k < SWEEP_EVENTS; ++k) {
            sigma[k] = 0.0;
            weighted[k] = vec3(0.0);
        }
        for (uint c = first; sweep_valid(c) && sweep_floor(c) < end; c = sweep_next(c)) {
            Segment s = sweep_segment(c, true);
            if (s.optical_depth > 0.0 && s.t_exit > done && s.t_enter < end) {
                float density = s.optical_depth / (s.t_exit - s.t_enter);
                float from = done;
                [[unroll]] for (uint k = 0u; k < SWEEP_EVENTS; ++k) {
                    if (s.t_enter <= from && s.t_exit >= times[k]) {
                        sigma[k] += density;
                        weighted[k] += density * s.colour;
                    }
                    from = times[k];
                }
            }
        }
        if (result.nearest == 1e30 && times[0] < SWEEP_NEVER) result.nearest = times[0];
        [[unroll]] for (uint k = 0u; k < SWEEP_EVENTS; ++k) {
            if (sigma[k] > 0.0) {
                float tau = sigma[k] * (times[k] - done);
                result.radiance += exp(-result.optical_depth) * opacity(tau) * (weighted[k] / sigma[k]);
                result.optical_depth += tau;
            }
            done = times[k];
        }
        more = more && exp(-result.optical_depth) > cutoff;
    }
    return result;
}

#endif
