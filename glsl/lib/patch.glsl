// Patches: as many pixels of a bin as a subgroup has lanes, one for each. What includes this defines WIDTH,
// the subgroup's.
#ifndef PATCH_GLSL
#define PATCH_GLSL

// The rectangle that `tile.glsl` gives to any run of WIDTH pixels that begins at a multiple of it.
const uint PATCH_X_LOG2 = WIDTH > 64u ? 4u : (WIDTH >= 16u ? 3u : (WIDTH == 8u ? 2u : 1u));
const uint PATCH_Y_LOG2 = WIDTH >= 64u ? 3u : (WIDTH == 32u ? 2u : 1u);
// The last pixel of a bin.
const ivec2 BIN_LAST = ivec2((1 << BIN_SIZE_LOG2) - 1);
#endif
