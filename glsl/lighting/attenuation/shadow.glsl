// How much of a particle stands between a place in a level and the light. CPU twin: src/reference/attenuation.rs.
#ifndef WELKIN_ATTENUATION_SHADOW
#define WELKIN_ATTENUATION_SHADOW
#include "common/particle.glsl"
#include "lighting/attenuation/params.glsl"

// No particle dims by more than exp(-256), which is 0 in f32.
const float GREATEST_DEPTH = 256.0;

vec3 attenuation_place(vec3 p_ws, uint level, in AttenuationParams a) {
    vec3 p = p_ws - a.anchor;   // first: small numbers are exact to less
    return vec3(dot(a.row_u[level].xyz, p) + a.row_u[level].w, dot(a.row_v[level].xyz, p) + a.row_v[level].w,
                dot(a.row_w[level].xyz, p) + a.row_w[level].w);
}

// A particle as the columns of voxels along the light meet it: an ellipsoid in a level.
struct Shadow {
    vec3  centre;      // [voxels]
    vec2  reach;       // across the light, from the centre [voxels]
    vec3  outline;     // xx, xy, yy of the matrix Q⁻¹: the shadow's outline is dᵀ Q⁻¹ d = 1
    vec2  shear;       // how the middle of a column's way moves along the light
    float half_depth;  // half the way through the centre [voxels]
    float depth;       // optical depth of that way
};

// The ellipsoid's shape matrix is S = M Mᵀ, its semi-axes mapped into the level. Particles smaller than voxels would fall
// between columns: across the light S is widened by 2 / (1 + S) voxels², and the optical depth thinned by as much, so that
// all matter is met; at a radius of five voxels that is less than 0.2 % of the radius. No difference of large numbers occurs: determinants are those
// of M, of its minors, and what the widening adds.
Shadow particle_shadow(Particle p, uint level, in AttenuationParams a) {
    vec3 axes = a.body * p.semi_axes;
    vec3 u = axes * rotate_inverse(p.rotation, a.row_u[level].xyz);
    vec3 v = axes * rotate_inverse(p.rotation, a.row_v[level].xyz);
    vec3 w = axes * rotate_inverse(p.rotation, a.row_w[level].xyz);
    float uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), ww = dot(w, w);
    vec2 b = vec2(dot(u, w), dot(v, w)), wider = 2.0 / (1.0 + vec2(uu, vv));
    vec3 uxv = cross(u, v), uxw = cross(u, w), vxw = cross(v, w);
    float volume = dot(uxv, w), volume2 = volume * volume;
    float across = dot(uxv, uxv) + wider.x * vv + wider.y * uu + wider.x * wider.y;
    float all_axes = volume2 + wider.x * dot(vxw, vxw) + wider.y * dot(uxw, uxw) + wider.x * wider.y * ww;
    uu += wider.x;
    vv += wider.y;
    Shadow s;
    s.centre = attenuation_place(p.centre, level, a);
    s.reach = sqrt(vec2(uu, vv));
    s.outline = vec3(vv, -uv, uu) / across;
    s.shear = vec2(s.outline.x * b.x + s.outline.y * b.y, s.outline.y * b.x + s.outline.z * b.y);
    s.half_depth = sqrt(all_axes / across);
    float metres = -1.0 / dot(a.row_w[level].xyz, a.to_sun);   // along the light, a voxel
    // 2 half_depth √(volume² / all_axes)
    s.depth = min(a.extinction * p.density * p.fade * metres * 2.0 * abs(volume) * inversesqrt(across), GREATEST_DEPTH);
    return s;
}

// Where the light's way through column `at` of a level begins and ends [voxels], and its optical depth; 0 beside the shadow.
vec3 shadow_column(Shadow s, vec2 at) {
    vec2 d = at - s.centre.xy;
    float q = s.outline.x * d.x * d.x + 2.0 * s.outline.y * d.x * d.y + s.outline.z * d.y * d.y;
    if (q >= 1.0) return vec3(0.0);
    float chord = sqrt(1.0 - q), middle = s.centre.z + dot(s.shear, d);
    return vec3(middle - s.half_depth * chord, middle + s.half_depth * chord, s.depth * chord);
}

// Optical depth of the particle between a place and the light.
float shadow_depth(Shadow s, vec3 place) {
    vec3 column = shadow_column(s, place.xy);
    return column.z * clamp((place.z - column.x) / max(column.y - column.x, 1e-6), 0.0, 1.0);
}

#endif
