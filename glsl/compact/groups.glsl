// Indirect dispatch over lists of any length.
#ifndef WELKIN_COMPACT_GROUPS
#define WELKIN_COMPACT_GROUPS

// Work groups for `count` items, `per_group` to a group. Every device takes 65535 groups a dimension, so long lists
// get a second one.
uvec4 groups_for(uint count, uint per_group) {
    uint needed = (count + per_group - 1u) / per_group;
    uint rows = (needed + 32767u) / 32768u;
    return uvec4(rows > 1u ? 32768u : needed, max(rows, 1u), 1u, 0u);
}

#endif
