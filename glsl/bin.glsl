// The pixels of a bin while raster works on them: what decides between two triangles, and where the
// winners are kept.
//
// Depth and key of each pixel are in shared memory, touched by one lane only, so that there is no
// barrier. What includes this defines WIDTH, the subgroup's, and COMPARE, the depth comparison.
#ifndef BIN_GLSL
#define BIN_GLSL

const bool GREATER = COMPARE == 4u || COMPARE == 6u;
const bool OR_EQUAL = COMPARE == 3u || COMPARE == 6u;

#include "lib/block.glsl"
#include "lib/depth.glsl"
#include "lib/tile.glsl"

layout(push_constant, scalar) uniform BatchBlock { Batch batch; };
layout(scalar, binding = 5) buffer Depth { float depth[]; };

shared float s_depth[BIN_PIXELS];
shared uint s_key[BIN_PIXELS];

// Whether (z, key) beats what the bin's pixel `at` holds. Among equals the comparison decides whether
// the first or the last in API order stays; a key of 0 is what was there before the batch.
bool beats(const float z, const uint key, const uint at) {
    float held = s_depth[at];
    bool wins = in_front(z, held);
    if (z == held) wins = OR_EQUAL ? key > s_key[at] : key < s_key[at];
    return wins;
}

// Puts the bin's pixels into shared memory: as the batch finds them, or all on one surface. Pixels
// beyond the target hold what nothing beats.
void fill(const ivec2 local_origin, const bool single, const uint key, const vec3 plane) {
    [[dont_unroll]] for (uint i = gl_SubgroupInvocationID; i < BIN_PIXELS; i += WIDTH) {
        ivec2 p = local_origin + ivec2(tile_pixel(i));
        float z = GREATER ? 2.0 : -1.0;
        if (p.x < int(batch.width) && p.y < int(batch.height)) {
            if (single) {
                z = depth_at(plane.x, plane.y, plane.z, p + ivec2(0, int(batch.origin_y)));
            } else {
                z = depth[uint(p.y) * batch.width + uint(p.x)];
            }
        }
        s_depth[i] = z;
        s_key[i] = key;
    }
}

// The farthest depth that a block holds.
float farthest_of(const uint block) {
    float far_z = GREATER ? 1.0 : 0.0;
    [[dont_unroll]] for (uint i = gl_SubgroupInvocationID; i < BLOCK; i += WIDTH) {
        float z = s_depth[block * BLOCK + i];
        far_z = GREATER ? min(far_z, z) : max(far_z, z);
    }
    return GREATER ? subgroupMin(far_z) : subgroupMax(far_z);
}
#endif
