// Light that comes in on every particle from one direction: multiple forward scattering (Harris 2.2.1, Eq. 4).
//
//     I_k = T_(k-1) I_(k-1) + g_(k-1),   I_1 = 1,
//
// over the particles in front of it, in the order of their centres along the light. The lists of the light's tiles have that
// order, by interlock or by sorting, so both give the same numbers. Each point of the light buffer keeps its own recurrence;
// a particle reads the mean of four points of a square around its centre, what the cone γ subtends as far away as the light
// enters the clouds (Stoian 3), and no wider than half of the particle. One thread a particle.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tiling/tile.glsl"
#include "grid/counters.glsl"
#include "compact/index.glsl"
#include "lighting/forward/params.glsl"
#include "lighting/forward/splat.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer TilingParamsBuffer { TilingParams tiling; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer Occluders { Occluder by[]; } occluders;
layout(set = 0, binding = 2, std430) readonly restrict buffer TileHeads { uint head[]; } tile_heads;
layout(set = 0, binding = 3, std430) readonly restrict buffer TileNodes { TileNode node[]; } tile_nodes;
layout(set = 0, binding = 4, std430) restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 5, std430) restrict buffer Incident { float at[]; } incident; // FORWARD_LIGHTS for each particle
layout(push_constant) uniform IncidentPush {
    uint  light;        // which
    uint  profile;      // SPLAT_*
    float forward;      // albedo · share of scattered light that stays in the cone
    float root_angle;   // √γ
    float resolution;   // texels along an edge of a level; 0: no buffer, points are where they are
} push;

// Half of what the particle measures along u and v [m].
vec2 half_extent(Occluder o) {
    float across = 1.0 / o.outline.z;
    return vec2(sqrt(1.0 + o.outline.y * o.outline.y * across * across) / o.outline.x, across);
}

// Edges of the square that a particle reads [m].
vec2 read_size(Occluder o, in TilingParams t) {
    vec2 d = o.centre.xz - t.centre.xz;
    float below_top = max(t.base - dot(d, d) * t.inverse_diameter + t.thickness - o.centre.y, 0.0);
    float way = t.to_sun.y > 1e-3 ? below_top / t.to_sun.y : 1e30;
    return min(vec2(push.root_angle * way), half_extent(o));
}

int of_four(ivec4 v, int i) { return i < 2 ? (i == 0 ? v.x : v.y) : (i == 2 ? v.z : v.w); }

void main() {
    uint index = linear_index();
    if (index >= counters.count.stored) return;
    Occluder self = occluders.by[index];
    uint key = light_key(light_depth(self.centre, params.tiling));
    uint level = receiver_level(self.centre, params.tiling);
    if (level >= params.tiling.level_count) {
        incident.at[index * FORWARD_LIGHTS + push.light] = 1.0;
        return;
    }
    // The four points, in tiles of the level, and from the centre [m].
    vec4 rect = params.tiling.level_rect[level];
    float dim = float(params.tiling.tile_dim);
    vec3 relative = self.centre - params.tiling.centre;
    vec2 middle = (vec2(dot(relative, params.tiling.u_axis), dot(relative, params.tiling.v_axis)) - rect.xy) * rect.zw;
    vec2 quarter = 0.25 * read_size(self, params.tiling) * rect.zw;
    vec4 at_u = middle.x + quarter.x * vec4(-1.0, 1.0, -1.0, 1.0);
    vec4 at_v = middle.y + quarter.y * vec4(-1.0, -1.0, 1.0, 1.0);
    if (push.resolution > 0.0) {
        float texels = push.resolution / dim;
        at_u = (floor(at_u * texels) + 0.5) / texels;
        at_v = (floor(at_v * texels) + 0.5) / texels;
    }
    at_u = clamp(at_u, 0.0, dim);
    at_v = clamp(at_v, 0.0, dim);
    vec4 from_u = (at_u - middle.x) / rect.z, from_v = (at_v - middle.y) / rect.w;
    ivec4 tile_u = min(ivec4(at_u), int(dim) - 1), tile_v = min(ivec4(at_v), int(dim) - 1);

    vec4 light = vec4(1.0);
    // Copies: a driver need not know that the loop reads the same each time.
    vec3 u_axis = params.tiling.u_axis, v_axis = params.tiling.v_axis;
    float extinction = 2.0 * params.tiling.extinction;
    uint limit = params.tiling.traversal_limit;
    uint visited = level >> 31u; // 0, which compilers do not see: a count that lanes share, lavapipe keeps in memory
    // Mostly all four lie in one tile.
    uint pending = 15u;
    while (pending != 0u) {
        int first = findLSB(pending);
        ivec2 tile = ivec2(of_four(tile_u, first), of_four(tile_v, first));
        uvec4 here = uvec4(equal(tile_u, ivec4(tile.x))) & uvec4(equal(tile_v, ivec4(tile.y)));
        pending &= ~(here.x | here.y << 1u | here.z << 2u | here.w << 3u);
        bvec4 taken = notEqual(here, uvec4(0u));
        vec4 low_u = mix(vec4(1e30), at_u, taken), low_v = mix(vec4(1e30), at_v, taken);
        vec4 high_u = mix(vec4(-1e30), at_u, taken), high_v = mix(vec4(-1e30), at_v, taken);
        uvec2 from = within_tile(min(min(vec2(low_u.x, low_v.x), vec2(low_u.y, low_v.y)),
                                     min(vec2(low_u.z, low_v.z), vec2(low_u.w, low_v.w))), tile);
        uvec2 to = within_tile(max(max(vec2(high_u.x, high_v.x), vec2(high_u.y, high_v.y)),
                                   max(vec2(high_u.z, high_v.z), vec2(high_u.w, high_v.w))), tile);
        // As pack_receiver for a rectangle: its far corner against where nodes begin, its near one against where they end.
        uint receiver = 0x80808080u | to.x | to.y << 8u | (127u - from.x) << 16u | (127u - from.y) << 24u;
        uint node = tile_heads.head[tile_index(tile, level, params.tiling)];
        while (node != NO_NODE && visited <= limit) {
            // Up to three nodes that miss in one go, as in sun_optical_depth.glsl.
            uint occluder = NO_NODE;
            for (int i = 0; i < 3; ++i) {
                if (occluder != NO_NODE || node == NO_NODE || ++visited > limit) continue;
                TileNode n = tile_nodes.node[node];
                // Front to back: what follows the particle itself lies behind it.
                bool behind = n.key > key || (n.key == key && n.particle >= index);
                node = behind ? NO_NODE : n.next;
                if (!behind && in_bounds(receiver, n.bounds)) occluder = n.particle;
            }
            if (occluder == NO_NODE) continue;
            Occluder o = occluders.by[occluder];
            vec3 away = self.centre - o.centre;
            vec4 u = dot(away, u_axis) + from_u, v = dot(away, v_axis) + from_v;
            vec4 x = o.outline.x * u + o.outline.y * v, y = o.outline.z * v;
            vec4 q = mix(vec4(1.0), x * x + y * y, taken);
            if (all(greaterThanEqual(q, vec4(1.0)))) continue;
            light *= splat_passes(splat_rest(q, push.profile), extinction * o.half_chord * o.density, push.forward);
        }
    }
    atomicMax(counters.count.longest_walk, visited);
    if (visited > limit) atomicAdd(counters.count.truncated, 1u);
    incident.at[index * FORWARD_LIGHTS + push.light] = dot(light, vec4(0.25));
}
