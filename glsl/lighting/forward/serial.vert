#version 460
// The quad around one splat (lighting/forward/serial.frag). `from_middle`: where on it [m].
layout(location = 0) out vec2 from_middle;
layout(push_constant) uniform SerialPush {
    vec2  middle;      // [normalised device coordinates]
    vec2  half_size;      // half of it, the same
    vec2  extent;      // half of it [m]
    vec2  reserved;
    vec3  outline;     // Occluder
    float opacity;     // in the middle
    float colour;      // light that it scatters on, in the middle
    uint  profile;     // SPLAT_*
} push;

void main() {
    vec2 corner = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 2.0 - 1.0;
    from_middle = corner * push.extent;
    gl_Position = vec4(push.middle + corner * push.half_size, 0.5, 1.0);
}
