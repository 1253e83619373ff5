// Volume-aware blending with more than one pending segment: a window of WINDOW disjoint stretches of the ray, each
// homogeneous, front to back. An arriving segment is split against them, overlaps get the summed extinction and the colour
// weighted by extinction, and where more than WINDOW stretches come out, the pair whose merging (Yusov Eq. 17), or the
// farthest one whose committing, is expected to cost least is reduced. CPU twin: src/reference/segments.rs, `window`.
// Cost: (2 WINDOW + 1) pieces of about 40 operations, and as many of about 25 for each reduction. Every loop unrolls.
//
// The includer defines WINDOW, 2 or more, as a constant or a specialization constant. No bindings in here.
#ifndef BLEND_WINDOW
#define BLEND_WINDOW
#extension GL_EXT_control_flow_attributes : require
#include "blend/merge.glsl"

const uint PIECES = 2u * WINDOW + 1u;
const uint TIMES = PIECES + 1u;
const float NEVER = 3.0e38;

// How likely something that is still to come reaches behind what has been drawn, at the least [1]. Tuned, like the costs
// below, on random rays sorted by distance, half sorted and shuffled.
const float LEAST_REACH = 0.03;

float sum3(vec3 v) { return v.x + v.y + v.z; }

// Inserts `value` into ascending `times`, of which the last is NEVER.
void insert_time(inout float times[TIMES], float value) {
    [[unroll]] for (uint i = PIECES; i > 0u; --i) times[i] = max(times[i - 1u], min(times[i], value));
    times[0] = min(times[0], value);
}

// Adds `incoming` to the window of a pixel. Segments come back to front; in any other order only the error grows. An unused
// segment has optical depth 0, and follows the used ones.
void insert(inout Segment window[WINDOW], inout Committed committed, Segment incoming) {
    if (incoming.optical_depth <= 0.0) return;
    committed.optical_depth += incoming.optical_depth;

    // Ends of the segments, then those of the incoming one among them: PIECES stretches, many of them empty.
    float times[TIMES];
    [[unroll]] for (uint i = 0u; i < WINDOW; ++i) {
        bool used = window[i].optical_depth > 0.0;
        times[2u * i] = used ? window[i].t_enter : NEVER;
        times[2u * i + 1u] = used ? window[i].t_exit : NEVER;
    }
    times[PIECES - 1u] = NEVER;
    times[PIECES] = NEVER;
    insert_time(times, incoming.t_enter);
    insert_time(times, incoming.t_exit);

    // Before the incoming segment, even stretches are those of the window, odd ones the gaps between them; behind its entry
    // it is the other way round, behind its exit as at first. So an even one has one owner, an odd one two or none.
    Segment pieces[PIECES];
    float opacities[PIECES];
    uint used = 0u;
    [[unroll]] for (uint j = 0u; j < PIECES; ++j) {
        float a = times[j], b = times[j + 1u];
        bool behind = incoming.t_exit <= a;
        bool inside = incoming.t_enter <= a && !behind;
        Segment piece = Segment(vec3(0.0), 0.0, a, b);
        if ((j & 1u) == 0u) {
            Segment owner = incoming;
            if (!inside) {
                owner.optical_depth = 0.0;
                if (behind) { if (j > 0u) owner = window[j / 2u - 1u]; }
                else if (j < PIECES - 1u) owner = window[j / 2u];
            }
            piece.colour = owner.colour;
            piece.optical_depth = part_optical_depth(owner, a, b);
        } else if (inside) {
            Segment other = window[j / 2u];
            float tau = part_optical_depth(incoming, a, b), tau_other = part_optical_depth(other, a, b);
            piece.optical_depth = tau + tau_other;
            piece.colour = (incoming.colour * tau + other.colour * tau_other) / max(piece.optical_depth, 1e-37);   // Eq. 15
        }
        pieces[j] = piece;
        opacities[j] = opacity(piece.optical_depth);
        if (piece.optical_depth > 0.0) ++used;
    }

    // What is still to come reaches up to about as far as the incoming segment, and is about as bright and as long. An error
    // counts by how much of it is seen and how likely it is to be met: a pair that becomes one, by how unevenly the two are
    // filled and coloured, where an end falls within; the farthest, by its opacity.
    float bright = sum3(incoming.colour);
    float per_length = 1.0 / max(incoming.t_exit - incoming.t_enter, 1e-6);
    for (; used > WINDOW; --used) {
        float least = NEVER, seen = 1.0, weight = 0.0;
        uint from = PIECES, into = PIECES, last = PIECES;
        Segment front = NO_SEGMENT, previous = NO_SEGMENT;
        float front_opacity = 0.0, previous_opacity = 0.0;
        [[unroll]] for (uint j = 0u; j < PIECES; ++j) {
            if (pieces[j].optical_depth <= 0.0) continue;
            Segment p = previous, q = pieces[j];
            if (last < PIECES) {
                float tau = p.optical_depth + q.optical_depth;
                float density = tau / max(q.t_exit - p.t_enter, 1e-6);
                float uneven = max(abs(p.optical_depth - density * (p.t_exit - p.t_enter)),
                                   abs(p.optical_depth - density * (q.t_enter - p.t_enter)));
                float motley = sum3(abs(p.colour - q.colour)) * min(previous_opacity, opacities[j]);
                float cost = weight * min((q.t_exit - p.t_enter) * per_length, 1.0) * (uneven * bright + motley);
                if (cost < least) {
                    least = cost;
                    from = last;
                    into = j;
                    front = p;
                    front_opacity = previous_opacity;
                }
            }
            last = j;
            previous = q;
            previous_opacity = opacities[j];
            weight = seen * clamp((incoming.t_exit - q.t_enter) * per_length, LEAST_REACH, 1.0);
            seen *= 1.0 - previous_opacity;
        }
        if (weight * previous_opacity * bright <= least) {
            committed.radiance = over(previous.colour, previous.optical_depth, committed.radiance);               // Eq. 13
            from = last;
            into = PIECES;
        }
        [[unroll]] for (uint j = 0u; j < PIECES; ++j) {
            if (j == from) pieces[j].optical_depth = 0.0;
            if (j == into) {
                float both = front_opacity + opacities[j] - front_opacity * opacities[j];
                vec3 radiance = front.colour * front_opacity + (1.0 - front_opacity) * opacities[j] * pieces[j].colour;
                pieces[j].colour = radiance / max(both, 1e-37);                                                   // Eq. 17
                pieces[j].optical_depth += front.optical_depth;
                pieces[j].t_enter = front.t_enter;
                opacities[j] = both;
            }
        }
    }

    // Used pieces close up.
    [[unroll]] for (uint i = 0u; i < WINDOW; ++i) window[i] = NO_SEGMENT;
    uint slot = 0u;
    [[unroll]] for (uint j = 0u; j < PIECES; ++j) {
        if (pieces[j].optical_depth <= 0.0) continue;
        [[unroll]] for (uint i = 0u; i < WINDOW; ++i) {
            if (i == slot) window[i] = pieces[j];
        }
        ++slot;
    }
}

// In-scattered radiance of everything inserted.
vec3 resolve_window(Segment window[WINDOW], Committed committed) {
    vec3 radiance = committed.radiance;
    [[unroll]] for (uint i = WINDOW; i > 0u; --i) radiance = over(window[i - 1u].colour, window[i - 1u].optical_depth, radiance);
    return radiance;
}

#endif
