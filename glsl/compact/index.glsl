// Index of this item in a list that `groups_for` dispatched to work groups of 64 threads.
#ifndef WELKIN_COMPACT_INDEX
#define WELKIN_COMPACT_INDEX

uint linear_group() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }
uint linear_index() { return linear_group() * 64u + gl_LocalInvocationIndex; }

#endif
