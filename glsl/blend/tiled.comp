#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// lighting: each
// Mode `tiled`: the exact integral along each pixel's ray, front to back, over the particles of its tile. One group a
// tile that has any, one thread a pixel; threads share nothing, so neither barriers nor a subgroup size matter.
//
// Particles come in the order of their entry bounds, so everything before the bound of the next one is known. Segments
// wait in a window; when it is full, all events up to that bound are integrated, which empties the places of segments
// that end there. A pixel whose window stays full is left to tiled_rest.comp. A particle that begins behind HIDDEN
// optical depths is never shaded, and a pixel ends when all later ones do.
#include "blend/tile_particle.glsl"
#include "blend/tiled_use.glsl"
#include "blend/bindings.glsl"
#include "blend/tiled_bindings.glsl"
#include "blend/segment.glsl"
layout(local_size_x = 64) in;
layout(push_constant) uniform TiledPush { uvec2 tiles; } push;

const uint WINDOW = 12u;
const float NEVER = 3.0e38;

// The window. Density 0 [1/m]: a free place.
float window_enter[WINDOW], window_exit[WINDOW], window_density[WINDOW];
vec3 window_colour[WINDOW];

// The ray up to `integrated` [m].
float integrated;
float optical_depth;
vec3 radiance;

// Integrates up to the last event that is not behind `bound`.
void integrate_to(float bound) {
    bool more = true;
    while (more) {
        float next = NEVER, sigma = 0.0;
        vec3 weighted = vec3(0.0);
        [[unroll]] for (uint k = 0u; k < WINDOW; ++k) {
            if (window_density[k] > 0.0) {
                bool inside = window_enter[k] <= integrated;
                next = min(next, inside ? window_exit[k] : window_enter[k]);
                sigma += inside ? window_density[k] : 0.0;
                weighted += inside ? window_density[k] * window_colour[k] : vec3(0.0);
            }
        }
        more = next <= bound && next < NEVER;
        if (more) {
            if (sigma > 0.0) {
                float tau = sigma * (next - integrated);
                radiance += exp(-optical_depth) * opacity(tau) * (weighted / sigma);
                optical_depth += tau;
            }
            integrated = next;
            [[unroll]] for (uint k = 0u; k < WINDOW; ++k) {
                if (window_exit[k] <= integrated) window_density[k] = 0.0;
            }
        }
    }
}

// Optical depth before distance `t`, as far as segments are known.
float known_depth(float t) {
    float tau = optical_depth;
    [[unroll]] for (uint k = 0u; k < WINDOW; ++k) {
        tau += window_density[k] * max(min(window_exit[k], t) - max(window_enter[k], integrated), 0.0);
    }
    return tau;
}

// False if the window is full.
bool insert(Segment s) {
    float density = s.optical_depth / (s.t_exit - s.t_enter);
    [[unroll]] for (uint k = 0u; k < WINDOW; ++k) {
        bool place = density > 0.0 && window_density[k] == 0.0;
        window_enter[k] = place ? s.t_enter : window_enter[k];
        window_exit[k] = place ? s.t_exit : window_exit[k];
        window_colour[k] = place ? s.colour : window_colour[k];
        window_density[k] = place ? density : window_density[k];
        density = place ? 0.0 : density;
    }
    return density == 0.0;
}

// The candidates of the next particles of the tile, one bit each, and where the first bit stands.
uint mask, base, cursor, end;

// The next particle that may be seen at `centre`; false if there is none.
bool next_candidate(vec2 centre, float t_opaque, out TileParticle candidate) {
    FrameParams f = frame.params;
    vec3 dir = view_ray(f, centre, vec2(f.low_width, f.low_height));
    bool found = false;
    while (!found && (mask != 0u || cursor < end)) {
        if (mask == 0u) {
            base = cursor;
            cursor = min(cursor + 32u, end);
            for (uint i = base; i < cursor; ++i) {
                TileParticle t = tile_particles.element[pair_particles.element[i]];
                if (conic_at(t.conic, centre - t.middle) <= 1.0) mask |= 1u << (i - base);
            }
        }
        if (mask != 0u) {
            uint bit = uint(findLSB(mask));
            mask &= mask - 1u;
            candidate = tile_particles.element[pair_particles.element[base + bit]];
            if (candidate.bound >= t_opaque || known_depth(candidate.bound) > HIDDEN) {
                mask = 0u;        // Nothing from here on is seen.
                cursor = end;
            } else {
                BallRay ray = ball_ray(particles.elements[candidate.particle], f.camera, dir);
                float t_enter = ray.t_closest - sqrt(max(1.0 - ray.b2, 0.0)) * ray.metres;   // Detail only shrinks it.
                found = ray.b2 < 1.0 && known_depth(max(t_enter, 0.0)) <= HIDDEN;
            }
        }
    }
    return found;
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (group >= tiled_use.value.tiles) return;
    uint tile = tile_list.tile[group];
    uvec2 pixel = uvec2(tile % push.tiles.x, tile / push.tiles.x) * TILE + tile_pixel(lane);
    bool on_screen = pixel.x < frame.params.low_width && pixel.y < frame.params.low_height;
    vec2 centre = vec2(pixel) + 0.5;
    mask = 0u;
    cursor = tile_ranges.end[2u * tile];
    end = on_screen ? tile_ranges.end[2u * tile + 1u] : 0u;
    integrated = -1.0;
    optical_depth = 0.0;
    radiance = vec3(0.0);
    [[unroll]] for (uint k = 0u; k < WINDOW; ++k) {
        window_enter[k] = 0.0;
        window_exit[k] = 0.0;
        window_density[k] = 0.0;
        window_colour[k] = vec3(0.0);
    }
    float first = 1e30;
    bool fits = true;
    float t_opaque = on_screen ? texelFetch(opaque_distance, ivec2(pixel), 0).x : 0.0;

    TileParticle candidate;
    bool more = next_candidate(centre, t_opaque, candidate);
    // The test stands at the end: where nothing branches, as in lavapipe, a last round for nobody would cost a full one.
    if (more) do {
        Segment s = particle_segment(candidate.particle, centre);
        if (s.optical_depth > 0.0) {
            first = min(first, s.t_enter);
            if (!insert(s)) {
                integrate_to(candidate.bound);
                fits = insert(s);
            }
        }
        more = fits && next_candidate(centre, t_opaque, candidate);
    } while (more);
    if (!on_screen) return;
    if (fits) {
        integrate_to(NEVER);
        store(ivec2(pixel), radiance, optical_depth, first);
    } else {
        uint half_tile = 2u * tile + (lane >> 5);
        if (atomicOr(rest.word[half_tile], 1u << (lane & 31u)) == 0u) {
            uint slot = atomicAdd(tiled_use.value.rest, 1u);
            rest.word[2u * push.tiles.x * push.tiles.y + slot] = half_tile;
        }
    }
}
