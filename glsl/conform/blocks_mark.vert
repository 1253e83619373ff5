#version 460
// A quad for each instance over the one pixel that is its own.
layout(push_constant) uniform BlocksMarkPush { uint width; uint height; } push;
layout(location = 0) flat out uint instance;

void main() {
    uvec2 pixel = uvec2(gl_InstanceIndex % push.width, gl_InstanceIndex / push.width);
    vec2 corner = vec2(pixel + uvec2(gl_VertexIndex & 1, gl_VertexIndex >> 1));
    gl_Position = vec4(2.0 * corner / vec2(push.width, push.height) - 1.0, 0.5, 1.0);
    instance = gl_InstanceIndex;
}
