#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_fragment_shader_interlock : require
// vertex: conform/layers.vert
// Runs for each sample: `gl_SampleID` makes it.
layout(constant_id = 4) const uint SAMPLES = 1;     // of a pixel
#define PER_SAMPLE
#include "conform/order.glsl"
