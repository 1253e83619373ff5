// Counts of one frame, copied to the host at its end. A list counts what it was asked to hold, also past its capacity,
// so that the host reads the true need and grows the list before the next frame.
#ifndef WELKIN_GRID_COUNTERS
#define WELKIN_GRID_COUNTERS

struct Counters {
    uint cells;       // cells classified
    uint valid_cells; // cells that hold cloud
    uint generated;   // particles wanted
    uint stored;      // particles that fit: min(generated, capacity)
    uint visible;     // particles in the view frustum
    uint tile_nodes;  // light list nodes wanted
    uint longest_walk; // light list nodes that one receiver visited, at most
    uint truncated;   // receivers whose walk hit the traversal limit
    uint blend_nodes; // list nodes that the blend mode wanted
};

#endif
