#version 460
// Writes the arguments of an indirect dispatch or draw on the device, from numbers that only the device has.
#extension GL_GOOGLE_include_directive : require
#include "conform/blocks.glsl"
layout(local_size_x = 1) in;

layout(binding = 0, std430) restrict readonly buffer ArgsSource { uvec4 numbers; } source;
layout(binding = 1, std430) restrict writeonly buffer ArgsOut { uvec4 args; } made;

void main() {
    uvec4 args = source.numbers;
    if (SABOTAGE == BROKEN_LOST) args.y = max(args.y, 1u) - 1u;
    if (SABOTAGE == BROKEN_REVERSED) args = args.wyzx;
    made.args = args;
}
