// Packs the flagged particles, in order, and gives each the key it is sorted by.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "compact/view.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 1, std430) readonly restrict buffer Flags { uint flag[]; } flags;
layout(set = 0, binding = 2, std430) readonly restrict buffer Slots { uint slot[]; } slots; // exclusive prefix sum of the flags
layout(set = 0, binding = 3, std430) writeonly restrict buffer Keys { uint key[]; } keys;
layout(set = 0, binding = 4, std430) writeonly restrict buffer Indices { uint index[]; } indices;
layout(push_constant) uniform ScatterPush {
    vec3 camera;
    uint capacity;
} push;

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.capacity || flags.flag[index] == 0u) return;
    uint slot = slots.slot[index];
    keys.key[slot] = back_to_front_key(particles.particle[index].centre, push.camera);
    indices.index[slot] = index;
}
