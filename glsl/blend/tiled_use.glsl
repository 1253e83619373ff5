// Counts and indirect arguments of mode `tiled`. Twin: src/blend/tiled.rs.
#ifndef BLEND_TILED_USE
#define BLEND_TILED_USE

struct TiledUse {
    uvec4 particle_groups;   // of 64 visible particles
    uvec4 particle_sort;     // of 1024
    uvec4 pair_groups;       // of 64 pairs of particle and tile
    uvec4 pair_sort;         // of 1024
    uvec4 tile_groups;       // tiles that any pair has
    uvec4 rest_groups;       // half tiles with pixels that are still to be done
    uint  particles;         // visible ones that fit
    uint  pairs;             // that fit
    uint  tiles;
    uint  rest;
};

#endif
