// What the integrating passes of mode `tiled` share. The first ones are those of blend/bindings.glsl.
layout(binding = 9, std430) restrict readonly buffer TileRanges { uint end[]; } tile_ranges;
layout(binding = 10, std430) restrict readonly buffer PairParticles { uint element[]; } pair_particles;
layout(binding = 11, std430) restrict readonly buffer TileParticles { TileParticle element[]; } tile_particles;
layout(binding = 13, std430) restrict buffer TiledUseBuffer { TiledUse value; } tiled_use;
layout(binding = 14, std430) restrict buffer Rest { uint word[]; } rest;   // per half tile: its unfinished pixels, then the list
layout(binding = 15) restrict writeonly uniform image2D cloud;             // in-scattered radiance, transmittance
layout(binding = 16) restrict writeonly uniform image2D nearest;           // distance to the first cloud [m]
layout(binding = 17, std430) restrict readonly buffer TileList { uint tile[]; } tile_list;

// What lies behind so much optical depth is left out: at most 1e-5 of its radiance would have come through.
const float HIDDEN = 11.5;

void store(ivec2 pixel, vec3 radiance, float optical_depth, float first) {
    imageStore(cloud, pixel, vec4(radiance, exp(-optical_depth)));
    imageStore(nearest, pixel, vec4(first));
}
