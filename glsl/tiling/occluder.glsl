// What the light meets of a particle, reduced once a particle to what every walk of a list asks (see Occluder).
#ifndef WELKIN_TILING_OCCLUDER
#define WELKIN_TILING_OCCLUDER
#include "common/particle.glsl"
#include "tiling/params.glsl"

// M maps to the unit ball. The point of the line x + t s nearest the centre, in that space, is M x - (M x · d / d²) d with
// d = M s: linear in x. Along u and v it spans the plane that the outline lies in.
Occluder occluder_of(Particle p, in TilingParams t) {
    vec3 d = to_unit_ball(p, vec4(t.to_sun, 0.0));
    vec3 u = to_unit_ball(p, vec4(t.u_axis, 0.0));
    vec3 v = to_unit_ball(p, vec4(t.v_axis, 0.0));
    float dd = dot(d, d);
    vec2 shear = vec2(dot(u, d), dot(v, d)) / dd;
    u -= shear.x * d;
    v -= shear.y * d;
    float along_u = length(u);
    float along_v = dot(u, v) / along_u;
    vec3 outline = vec3(along_u, along_v, length(v - u * (along_v / along_u)));
    return Occluder(p.centre, inversesqrt(dd), outline, p.density * p.fade, shear);
}

// Lengths of the way along the light through the occluder in front of three points: `reach` ahead of the one that lies
// `offset` from the occluder's centre (along u, along v, towards the light), there, and `reach` behind it [m].
vec3 chords_ahead(Occluder o, vec3 offset, float reach) {
    vec2 passes = vec2(o.outline.x * offset.x + o.outline.y * offset.y, o.outline.z * offset.y);
    float half_chord = o.half_chord * sqrt(max(1.0 - dot(passes, passes), 0.0));
    vec3 to_middle = -offset.z - dot(o.shear, offset.xy) - vec3(reach, 0.0, -reach);
    return max(to_middle + half_chord, 0.0) - max(to_middle - half_chord, 0.0);
}

#endif
