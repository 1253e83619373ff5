// Counter-based random numbers: pcg4d of Jarzynski and Olano ("Hash Functions for GPU Rendering", 2020). A draw is a
// function of pixel, sample, number of the draw and seed, so nothing depends on scheduling.
#ifndef PATHTRACE_RANDOM
#define PATHTRACE_RANDOM

uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    v ^= v >> 16u;
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    return v;
}

// Uniform in [0, 1), multiples of 2^-24.
vec4 unit_interval(uvec4 bits) { return vec4(bits >> 8u) * (1.0 / 16777216.0); }

// Exponentially distributed with mean 1, from a number in [0, 1) as above; 17 at most, which is exceeded once in 3e7.
float exponential(float u) { return -log(u + 0.5 / 16777216.0); }

#endif
