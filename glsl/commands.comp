// Commands: makes the pieces of a batch from draw commands, which only the device knows.
//
// Reads: the piece that is their template; the commands and their number, in the resource table.
// Writes: a piece for each command that there may be, and one more; their order; the arguments of the dispatches over
// their vertex slots and their primitives.
// Contract: the pieces are those that the planner makes of the same draws, one for each primitive of the batch, in API
// order. A piece without primitives has an empty rectangle. The last piece has none, and all primitives behind those of
// the commands belong to such a piece. A command whose indices are not all there has no primitives.
// Kernel / Twin: src/compute/commands.rs; no twin, pictures are compared with those of the same draws.
//
// One subgroup walks all commands, as in `binning_scan.comp`.
#version 460
#extension GL_EXT_nonuniform_qualifier : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "abi.glsl"
#include "lib/assembly.glsl"

layout(constant_id = SPEC_WIDTH) const uint SUBGROUP_WIDTH = 8u;
layout(local_size_x_id = SPEC_WIDTH) in;
layout(push_constant, scalar) uniform CommandsBlock { Commands commands; };
layout(scalar, set = SET_TABLE, binding = TABLE_BUFFERS) readonly buffer Words { uint words[]; } table[];
layout(scalar, binding = 0) readonly buffer Pieces { Piece pieces[]; };
layout(scalar, binding = 1) writeonly buffer CommandPieces { Piece command_pieces[]; };
layout(scalar, binding = 2) writeonly buffer Runs { uint runs[]; };
// Twice three words: the arguments of a dispatch over vertex slots, and of one over primitives.
layout(scalar, binding = 3) writeonly buffer CommandArgs { uint command_args[]; };

uint word_at(const uint slot, const uint byte) {
    return table[nonuniformEXT(slot + (byte >> WINDOW_LOG2))].words[(byte & ((1u << WINDOW_LOG2) - 1u)) >> 2];
}

// The part of a range of primitives up to `end` that lies in the batch or before it.
uint in_batch(const uint end) {
    return end <= commands.first ? 0u : min(end - commands.first, commands.primitives);
}

void write_args(const uint at, const uint items, const uint of_group) {
    uint groups = (items + of_group - 1u) / of_group;
    command_args[at] = min(groups, 65535u);
    command_args[at + 1u] = (groups + 65534u) / 65535u;
    command_args[at + 2u] = 1u;
}

void main() {
    uint lane = gl_SubgroupInvocationID;
    uint count = commands.draws;
    if (commands.count_slot != NONE) count = min(count, word_at(commands.count_slot, commands.count_byte));
    Piece base = pieces[commands.piece];
    // Primitives behind the batch do not matter, so that no number overflows.
    uint most = commands.first + commands.primitives;
    uint before = 0u;
    for (uint chunk = 0u; chunk <= commands.draws; chunk += SUBGROUP_WIDTH) {
        uint i = chunk + lane;
        // Lanes without a command read the first one: a driver may access what a lane reads even while the lane is
        // switched off.
        bool there = i < count;
        uint byte = commands.byte + (there ? i * commands.stride : 0u);
        uint elements = word_at(commands.slot, byte), instances = word_at(commands.slot, byte + 4u);
        uint first = word_at(commands.slot, byte + 8u), fourth = word_at(commands.slot, byte + 12u);
        uint fifth = commands.elements != NONE ? word_at(commands.slot, byte + 16u) : fourth;
        bool inside = commands.elements == NONE || (first <= commands.elements && elements <= commands.elements - first);
        uint of_one = there && inside ? primitives_of(base.topology, elements) : 0u;
        uint own = of_one == 0u ? 0u : instances > most / of_one ? most : min(of_one * instances, most);
        uint start = before + subgroupExclusiveAdd(own);
        uint low = in_batch(start), high = in_batch(start + own);
        if (i <= commands.draws) {
            Piece piece = base;
            piece.first_in_draw = start < commands.first ? commands.first - start : 0u;
            piece.primitives_per_instance = of_one;
            piece.first_primitive = low;
            piece.vertex_base = 4u * low;
            piece.vertex_slots = 4u * (high - low);
            piece.varying_base = 4u * low * base.varying_stride;
            piece.first_element = base.first_element + first;
            piece.base_vertex = commands.elements == NONE ? 0 : int(fourth);
            piece.first_instance = fifth;
            piece.draw_id = i;
            if (low == high) {
                piece.rect_min = ivec2(1);
                piece.rect_max = ivec2(0);
            }
            command_pieces[i] = piece;
            runs[i] = i;
        }
        before = min(before + subgroupAdd(own), most);
    }
    if (lane == 0u) {
        uint primitives = in_batch(before);
        write_args(0u, 4u * primitives, commands.of_group[0]);
        write_args(3u, primitives, commands.of_group[1]);
    }
}
