// Flags the particles that the camera may see. One thread for every slot of the particle list, used or not.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "compact/view.glsl"
#include "grid/counters.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 1, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 2, std430) writeonly restrict buffer Flags { uint flag[]; } flags;
layout(push_constant) uniform VisiblePush {
    vec4 plane[5];
    uint capacity;
} push;

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.capacity) return;
    bool visible = false;
    if (index < counters.count.stored) {
        Particle p = particles.particle[index];
        visible = p.density * p.fade > 0.0 && reaches_into(p, push.plane);
    }
    flags.flag[index] = visible ? 1u : 0u;
}
