#version 460
// Squares each element: the smallest program that exercises build, binding, push constants, specialization and barriers.
layout(local_size_x = 64) in;
layout(constant_id = 0) const uint OFFSET = 0;

struct Element { vec3 position; float value; };
layout(binding = 0, std430) restrict readonly buffer Input { float numbers[]; } source;
layout(binding = 1, std430) restrict writeonly buffer Output { Element elements[]; } squares;
layout(push_constant) uniform SquarePush { uint count; float scale; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index < count) squares.elements[index] = Element(vec3(index), scale * source.numbers[index] * source.numbers[index] + OFFSET);
}
