#version 460
// Samples a 3D table at given places.
#extension GL_GOOGLE_include_directive : require
#include "conform/blocks.glsl"
layout(local_size_x = 64) in;

layout(binding = 0) uniform sampler3D volume;
layout(binding = 1, std430) restrict readonly buffer SamplePlaces { vec4 place[]; } places;
layout(binding = 2, std430) restrict writeonly buffer SampleValues { vec4 value[]; } values;

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= places.place.length()) return;
    vec3 p = places.place[index].xyz;
    if (SABOTAGE == BROKEN_LOST) p += 0.5 / vec3(textureSize(volume, 0));   // forgets that texels have centres
    if (SABOTAGE == BROKEN_REVERSED) p.x = 1.0 - p.x;
    values.value[index] = textureLod(volume, p, 0.0);
}
