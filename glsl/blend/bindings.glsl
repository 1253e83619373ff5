// What every mode reads to make segments. The vertex shader shares bindings 0 and 1, and has the drawing order at 2.
layout(binding = 0, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 1, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 3, std430) restrict readonly buffer Lights { ParticleLight elements[]; } lights;
layout(binding = 4, std430) restrict readonly buffer Medium { MediumParams params; } medium;
layout(binding = 5) uniform sampler3D optical_depth_lut;
layout(binding = 6) uniform sampler3D scattering_lut;
layout(binding = 7) uniform sampler3D detail_tile;
layout(binding = 8) uniform sampler2D opaque_distance;

layout(binding = 18, std430) restrict readonly buffer Volume { VolumeParams params; } volume;
layout(binding = 19) uniform sampler3D light_volume;
layout(binding = 12, std430) restrict readonly buffer Sky { SkyLight params; } sky_light;

