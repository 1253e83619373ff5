// What every mode reads to make segments. The vertex shader shares bindings 0 and 1, and has the drawing order at 2. Bindings
// below 32 are the modes', those from 32 on the lighting methods' (lighting/hit.glsl).
#include "blend/ellipsoid.glsl"
#include "blend/merge.glsl"
#include "detail/displace.glsl"
#include "lut/optical_depth_lookup.glsl"
#include "medium/params.glsl"
layout(binding = 0, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 1, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 4, std430) restrict readonly buffer Medium { MediumParams params; } medium;
layout(binding = 5) uniform sampler3D optical_depth_lut;
layout(binding = 7) uniform sampler3D detail_tile;
layout(binding = 8) uniform sampler2D opaque_distance;
