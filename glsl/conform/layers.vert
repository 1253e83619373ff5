#version 460
#extension GL_GOOGLE_include_directive : require
// Rectangles in drawing order, six vertices each: as many to an instance as the push constants say, so that the same
// rectangles can come as draws, as primitives of one instance or as instances.
#include "conform/layer.glsl"
layout(binding = 0, std430) restrict readonly buffer Layers { ConformLayer elements[]; } layers;
layout(location = 0) flat out uint layer;

void main() {
    const uint corners[6] = uint[](0u, 1u, 2u, 2u, 1u, 3u);
    ConformLayer l = layers.elements[push.first + uint(gl_InstanceIndex) * push.per_instance + uint(gl_VertexIndex) / 6u];
    uint corner = corners[uint(gl_VertexIndex) % 6u];
    layer = l.index;
    gl_Position = vec4(mix(l.bounds.xy, l.bounds.zw, vec2(corner & 1u, corner >> 1)), l.depth, 1.0);
}
