#version 460
#extension GL_GOOGLE_include_directive : require
// Particles in each cell's list.
#include "pathtrace/cells.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict readonly buffer CellParamsBuffer { CellParams cells; } params;
layout(binding = 1, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 2, std430) restrict readonly buffer CellCounts { uint count[]; } cell_counts;
layout(binding = 3, std430) restrict readonly buffer CellFirst { uint first[]; } cell_first;
layout(binding = 4, std430) restrict coherent buffer EntryCounts { uint count[]; } entry_counts;
void visit(uint cell, uint particle) { atomicAdd(entry_counts.count[cell], 1u); }
#include "pathtrace/cover.glsl"
