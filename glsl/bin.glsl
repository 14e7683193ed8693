// The samples of a bin while raster works on them: the rule that decides between two triangles, and the
// memory that holds the winners.
//
// Raster keeps the depth and the key of each sample in shared memory and copies them to `depth` and
// `visibility` at the end. With IN_PLACE it keeps them in `depth` and `visibility` from the start: all
// memory is the same to a CPU, and this saves the copy. Only one lane touches each pixel, so no barrier is
// needed. The file that includes this one defines SUBGROUP_WIDTH and COMPARE (the depth comparison).
#ifndef BIN_GLSL
#define BIN_GLSL

layout(constant_id = SPEC_HELD) const uint HELD = BIN_PIXELS;
const bool IN_PLACE = HELD == 1u;

const bool GREATER = COMPARE == COMPARE_GREATER || COMPARE == COMPARE_GREATER_OR_EQUAL;
const bool OR_EQUAL = COMPARE == COMPARE_LESS_OR_EQUAL || COMPARE == COMPARE_GREATER_OR_EQUAL;

#include "lib/block.glsl"
#include "lib/depth.glsl"
#include "lib/lanes.glsl"
#include "lib/stencil.glsl"
#include "lib/tile.glsl"

layout(push_constant, scalar) uniform BatchBlock { Batch batch; };
layout(scalar, binding = 5) buffer Depth { float depth[]; };

layout(scalar, binding = 6) buffer Visibility { uvec4 visibility[]; };
layout(scalar, binding = 10) buffer Stencil { uint stencil[]; };

shared float s_depth[HELD];
shared uint s_key[HELD];

// A bin of the band: its number and its first pixel.
struct Bin {
    uint number;
    ivec2 origin;
};

// The index in `depth` of sample `s` of the bin's pixel at `p`. The pixel has to lie in the target.
uint depth_place(const Bin bin, const ivec2 p, const uint s) {
    return (uint(bin.origin.y + p.y) * batch.width + uint(bin.origin.x + p.x)) * SAMPLES + s;
}

// The index in `visibility` of sample `s` of the quad of the bin's pixel `i`.
uint key_place(const Bin bin, const uint i, const uint s) {
    return (bin.number * BIN_QUADS + (i >> 2)) * SAMPLES + s;
}

// The target's place of sample `s` of the bin's pixel at `p`.
vec2 place_of(const Bin bin, const ivec2 p, const uint s) {
    return sample_place(bin.origin + p + ivec2(0, int(batch.origin_y)), s);
}

bool in_target(const Bin bin, const ivec2 p) {
    return bin.origin.x + p.x < int(batch.width) && bin.origin.y + p.y < int(batch.height);
}

// The depth that sample `s` of pixel `i` of the bin holds; the pixel is at `p`.
float held_depth(const Bin bin, const uint i, const ivec2 p, const uint s) {
    return IN_PLACE ? depth[depth_place(bin, p, s)] : s_depth[i * SAMPLES + s];
}

uint held_key(const Bin bin, const uint i, const uint s) {
    return IN_PLACE ? visibility[key_place(bin, i, s)][i & 3u] : s_key[i * SAMPLES + s];
}

void hold(const Bin bin, const uint i, const ivec2 p, const uint s, const float z, const uint key) {
    if (IN_PLACE) {
        depth[depth_place(bin, p, s)] = z;
        visibility[key_place(bin, i, s)][i & 3u] = key;
    } else {
        s_depth[i * SAMPLES + s] = z;
        s_key[i * SAMPLES + s] = key;
    }
}

// Whether (z, key) beats the depth and the key that the sample holds. If the depths are equal, the comparison
// decides whether the first or the last triangle in API order wins. A sample that no triangle of the batch
// has won yet holds the key 0.
bool beats(const Bin bin, const uint i, const ivec2 p, const uint s, const float z, const uint key) {
    float held = held_depth(bin, i, p, s);
    bool wins = in_front(z, held);
    if (z == held) wins = OR_EQUAL ? key > held_key(bin, i, s) : key < held_key(bin, i, s);
    return wins;
}

// Whether a triangle with this stencil test passes at a sample of the bin's pixel at `p`, where it beats all that was there.
// If it does, its stencil value is written. A triangle that wins later writes its own (`StencilState::unordered`).
bool stencil_takes(const Bin bin, const ivec2 p, const uint s, const uvec2 face) {
    if (!is_tested(face)) return true;
    uint at = depth_place(bin, p, s), held = stencil[at];
    if (!stencil_passes(face, held)) return false;
    stencil[at] = stencil_after(face, STENCIL_PASS_SHIFT, held);
    return true;
}

// Sets the bin's samples to their state before the batch or, if `single`, to one surface: the depth of
// `plane`, adjusted, and the key `key`.
void fill(const Bin bin, const bool single, const uint key, const vec3 plane, const vec3 adjustment) {
    [[dont_unroll]] for (uint i = gl_SubgroupInvocationID; i < BIN_PIXELS; i += SUBGROUP_WIDTH) {
        ivec2 p = ivec2(tile_pixel(i));
        if (!in_target(bin, p)) continue;
        for (uint s = 0u; s < SAMPLES; s++) {
            float z = 0.0;
            if (single) z = depth_at(plane, adjustment, place_of(bin, p, s));
            else if (!IN_PLACE) z = depth[depth_place(bin, p, s)];
            if (IN_PLACE && key == 0u) visibility[key_place(bin, i, s)][i & 3u] = 0u;
            else hold(bin, i, p, s, z, key);
        }
    }
}

// Writes the depth of a triangle that covers the bin to all of its samples. Shading such a bin needs no visibility.
void cover(const Bin bin, const vec3 plane, const vec3 adjustment) {
    ivec2 lane_pixel = ivec2(tile_pixel(gl_SubgroupInvocationID));
    [[dont_unroll]] for (int left = 0; left <= BIN_LAST.x; left += 1 << PATCH_X_LOG2) {
        for (uint s = 0u; s < SAMPLES; s++) {
            float column = depth_of_column(plane.x, plane.y, place_of(bin, ivec2(left + lane_pixel.x, 0), s).x);
            [[dont_unroll]] for (int top = 0; top <= BIN_LAST.y; top += 1 << PATCH_Y_LOG2) {
                ivec2 p = ivec2(left, top) + lane_pixel;
                depth[depth_place(bin, p, s)] = depth_in_column(column, plane.z, adjustment, place_of(bin, p, s).y);
            }
        }
    }
}

// The farthest depth that a block holds.
float farthest_of(const Bin bin, const uint block) {
    float far_z = GREATER ? 1.0 : 0.0;
    [[dont_unroll]] for (uint i = block * BLOCK + gl_SubgroupInvocationID; i < (block + 1u) * BLOCK; i += SUBGROUP_WIDTH) {
        ivec2 p = ivec2(tile_pixel(i));
        if (!in_target(bin, p)) continue;
        for (uint s = 0u; s < SAMPLES; s++) {
            float z = held_depth(bin, i, p, s);
            far_z = GREATER ? min(far_z, z) : max(far_z, z);
        }
    }
    return GREATER ? lanes_min(far_z) : lanes_max(far_z);
}
#endif
