// Ellipsoid against frustum, and the order of drawing.
#ifndef WELKIN_COMPACT_VIEW
#define WELKIN_COMPACT_VIEW
#include "common/particle.glsl"

// Half the ellipsoid's extent along unit direction `d`: |A Rᵀ d|.
float ellipsoid_extent(Particle p, vec3 d) {
    return length(p.semi_axes * rotate_inverse(p.rotation, d));
}

// Conservative: true for every ellipsoid that reaches into the frustum. Planes (n, d) with n·x + d ≥ 0 inside.
// The slack covers f32 rounding of positions up to 2·10⁵ m, so that device and reference may differ only where the
// answer does not matter.
bool reaches_into(Particle p, vec4 planes[5]) {
    for (int i = 0; i < 5; ++i) {
        float distance = dot(planes[i].xyz, p.centre) + planes[i].w;
        if (distance < -ellipsoid_extent(p, planes[i].xyz) * 1.001 - 0.05) return false;
    }
    return true;
}

// Squared distance as an integer that sorts far particles first. Exact arithmetic: the order of two particles is the
// same on every device.
uint back_to_front_key(vec3 centre, vec3 camera) {
    precise float x = centre.x - camera.x;
    precise float y = centre.y - camera.y;
    precise float z = centre.z - camera.z;
    precise float xx = x * x;
    precise float yy = y * y;
    precise float zz = z * z;
    precise float d2 = (xx + yy) + zz;
    return ~floatBitsToUint(d2);
}

#endif
