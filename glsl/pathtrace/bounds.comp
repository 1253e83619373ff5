#version 460
#extension GL_GOOGLE_include_directive : require
// Box around all particles that have any extinction. Bounds are kept as integers that order as the floats do.
#include "pathtrace/cells.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 1, std430) restrict coherent buffer Bounds { uint least[3]; uint greatest[3]; } bounds;
layout(push_constant) uniform BoundsPush { uint count; } push;

uint ordered(float x) {
    uint bits = floatBitsToUint(x);
    return (bits >> 31u) == 0u ? bits | 0x80000000u : ~bits;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.count) return;
    Particle p = particles.elements[index];
    if (!(p.density * p.fade > 0.0)) return;
    vec3 reach = ellipsoid_reach(p);
    for (int i = 0; i < 3; ++i) {
        atomicMin(bounds.least[i], ordered(p.centre[i] - reach[i]));
        atomicMax(bounds.greatest[i], ordered(p.centre[i] + reach[i]));
    }
}
