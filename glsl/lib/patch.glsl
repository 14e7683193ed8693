// Patches: as many pixels of a bin as a subgroup has lanes, one for each. What includes this defines SUBGROUP_WIDTH,
// the subgroup's.
#ifndef PATCH_GLSL
#define PATCH_GLSL

// The rectangle that `tile.glsl` gives to any run of SUBGROUP_WIDTH pixels that begins at a multiple of it.
const uint PATCH_X_LOG2 = SUBGROUP_WIDTH > 64u ? 4u : (SUBGROUP_WIDTH >= 16u ? 3u : (SUBGROUP_WIDTH == 8u ? 2u : 1u));
const uint PATCH_Y_LOG2 = SUBGROUP_WIDTH >= 64u ? 3u : (SUBGROUP_WIDTH == 32u ? 2u : 1u);
// The last pixel of a bin.
const ivec2 BIN_LAST = ivec2((1 << BIN_SIZE_LOG2) - 1);
#endif
