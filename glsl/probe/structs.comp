#version 460
#extension GL_GOOGLE_include_directive : require
// Makes the layout of the shared structs known to the build, whether or not another program uses them yet.
#include "common/frame.glsl"
#include "common/particle.glsl"
layout(local_size_x = 1) in;
layout(binding = 0, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 1, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 2, std430) restrict readonly buffer Lights { ParticleLight elements[]; } lights;
layout(binding = 3, std430) restrict writeonly buffer Output { vec4 value; } result;
void main() {
    result.value = vec4(view_ray(frame.params, vec2(0.5), vec2(1.0)), particles.elements[0].density + lights.elements[0].ambient);
}
