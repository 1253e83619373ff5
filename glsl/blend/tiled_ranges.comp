#version 460
#extension GL_GOOGLE_include_directive : require
// Mode `tiled`: where each tile's pairs begin and end, after they have been sorted by tile; and the tiles that have any, in
// arbitrary order, which decides nothing but the order of work.
#include "blend/tiled_use.glsl"
#include "compact/index.glsl"
layout(local_size_x = 64) in;
layout(binding = 0, std430) restrict buffer TiledUseBuffer { TiledUse value; } tiled_use;
layout(binding = 1, std430) restrict readonly buffer PairTiles { uint tile[]; } pair_tiles;
layout(binding = 2, std430) restrict writeonly buffer TileRanges { uint end[]; } tile_ranges;   // first and end of each tile
layout(binding = 3, std430) restrict writeonly buffer TileList { uint tile[]; } tile_list;

void main() {
    uint i = linear_index();
    if (i >= tiled_use.value.pairs) return;
    uint tile = pair_tiles.tile[i];
    if (i == 0u || pair_tiles.tile[i - 1u] != tile) {
        tile_ranges.end[2u * tile] = i;
        tile_list.tile[atomicAdd(tiled_use.value.tiles, 1u)] = tile;
    }
    if (i + 1u == tiled_use.value.pairs || pair_tiles.tile[i + 1u] != tile) tile_ranges.end[2u * tile + 1u] = i + 1u;
}
