#version 460
#extension GL_GOOGLE_include_directive : require
// vertex: lighting/forward/serial.vert
// One splat of the papers' light pass, blended as src + (1 - src alpha) dst (Harris, Fig. 4). For measuring alone:
// src/lighting/forward/serial.rs.
#include "lighting/forward/splat.glsl"
layout(location = 0) in vec2 from_middle;
layout(location = 0) out vec4 light;
layout(push_constant) uniform SerialPush {
    vec2  middle;
    vec2  half_size;
    vec2  extent;
    vec2  reserved;
    vec3  outline;
    float opacity;
    float colour;
    uint  profile;
} push;

void main() {
    float across = push.outline.x * from_middle.x + push.outline.y * from_middle.y;
    float along = push.outline.z * from_middle.y;
    float share = 1.0 - splat_rest(vec4(across * across + along * along), push.profile).x;
    light = share * vec4(vec3(push.colour), push.opacity);
}
