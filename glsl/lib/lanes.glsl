// Sets of lanes, as ballots give them. The file that includes this one defines SUBGROUP_WIDTH. All lanes of the
// subgroup call these functions together. A set of 32 lanes or fewer is in the first word; the others cost nothing.
#ifndef LANES_GLSL
#define LANES_GLSL
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require

// The lanes in which `own` is true. Subgroups of 8 lanes or fewer are CPUs', whose drivers make a ballot a loop over
// the lanes; a shuffle is a few instructions there.
uvec4 lanes_where(const bool own) {
    if (SUBGROUP_WIDTH > 8u) return subgroupBallot(own);
    uint lanes = own ? 1u << gl_SubgroupInvocationID : 0u;
    [[unroll]] for (uint step = 1u; step < min(SUBGROUP_WIDTH, 8u); step <<= 1) lanes |= subgroupShuffleXor(lanes, step);
    return uvec4(lanes, 0u, 0u, 0u);
}

bool has_lanes(const uvec4 lanes) {
    return SUBGROUP_WIDTH > 32u ? lanes != uvec4(0u) : lanes.x != 0u;
}

uint first_lane(const uvec4 lanes) {
    if (SUBGROUP_WIDTH > 32u) return subgroupBallotFindLSB(lanes);
    return uint(findLSB(lanes.x));
}

uvec4 without_first_lane(uvec4 lanes) {
    if (SUBGROUP_WIDTH > 32u) {
        uint lane = subgroupBallotFindLSB(lanes);
        lanes[lane >> 5] &= lanes[lane >> 5] - 1u;
    } else {
        lanes.x &= lanes.x - 1u;
    }
    return lanes;
}

bool has_lane(const uvec4 lanes, const uint lane) {
    return SUBGROUP_WIDTH > 32u ? subgroupBallotBitExtract(lanes, lane) : (lanes.x >> lane & 1u) != 0u;
}

// The greatest value of all lanes, and the least.
float lanes_max(float value) {
    if (SUBGROUP_WIDTH > 8u) return subgroupMax(value);
    [[unroll]] for (uint step = 1u; step < min(SUBGROUP_WIDTH, 8u); step <<= 1) value = max(value, subgroupShuffleXor(value, step));
    return value;
}

float lanes_min(const float value) {
    return SUBGROUP_WIDTH > 8u ? subgroupMin(value) : -lanes_max(-value);
}
#endif
