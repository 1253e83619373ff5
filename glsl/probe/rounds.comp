#version 460
// Counts the rounds of a loop whose length the compiler cannot know: some drivers end long loops early, without a word.
layout(local_size_x = 1) in;
layout(binding = 0, std430) restrict buffer Rounds { uint wanted; uint done; } rounds;

void main() {
    uint sum = 0u;
    for (uint i = 0u; i < rounds.wanted; ++i) sum += 1u + (rounds.wanted >> 31);
    rounds.done = sum;
}
