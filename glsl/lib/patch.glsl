// Patches: a patch has one pixel of a bin for each lane of a subgroup. The file that includes this one defines
// SUBGROUP_WIDTH.
#ifndef PATCH_GLSL
#define PATCH_GLSL

// The size of a patch: `tile.glsl` makes any SUBGROUP_WIDTH pixels that begin at a multiple of it such a rectangle.
const uint PATCH_X_LOG2 = SUBGROUP_WIDTH > 64u ? 4u : (SUBGROUP_WIDTH >= 16u ? 3u : (SUBGROUP_WIDTH == 8u ? 2u : 1u));
const uint PATCH_Y_LOG2 = SUBGROUP_WIDTH >= 64u ? 3u : (SUBGROUP_WIDTH == 32u ? 2u : 1u);
// The last pixel of a bin.
const ivec2 BIN_LAST = ivec2((1 << BIN_SIZE_LOG2) - 1);
#endif
