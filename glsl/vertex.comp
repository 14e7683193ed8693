// Vertex: the user's vertex shader, once for each vertex slot.
//
// Reads: pieces, index buffers, vertex buffers and whatever the shader binds.
// Writes: the clip-space position and the varyings of each slot.
// Contract: slot `s` holds what the graphics pipeline's vertex stage would output for that vertex
// and instance; the stage stores nothing else.
// Kernel / Twin: src/compute/vertex.rs; no twin, the shader is the user's.
//
// The shader is spliced into `tw_user_main`; the functions and globals called tw_* are what it sees.
#version 460
#include "pieces.glsl"
#include "lib/attribute.glsl"

layout(local_size_x = GROUP) in;
layout(scalar, binding = 1) writeonly buffer Positions { vec4 positions[]; };
layout(scalar, binding = 2) writeonly buffer Varyings { uint varyings[]; };
layout(scalar, binding = 3) readonly buffer Attributes { Attribute attributes[]; };
layout(scalar, binding = 4) readonly buffer ResourceSlots { uint resource_slots[]; };
// Pieces in the order of their vertex slots.
layout(scalar, binding = 5) readonly buffer Runs { uint runs[]; };

int tw_VertexIndex, tw_InstanceIndex, tw_BaseVertex, tw_BaseInstance, tw_DrawIndex;
vec4 tw_Position;
float tw_PointSize;

uint resource_base;
uint attribute_base;
uint varying_base;

uint tw_resource(const in uint i) {
    return resource_slots[resource_base + i];
}

uvec4 fetch(const uint location, const uint one) {
    Attribute a = attributes[attribute_base + location];
    uvec4 value = uvec4(0u, 0u, 0u, one);
    if (a.slot == NONE) return value;
    uint index = uint(a.per_instance != 0u ? tw_InstanceIndex : tw_VertexIndex);
    uint byte = a.offset + a.stride * index, size = component_bytes(a.component);
    for (uint c = 0u; c < a.count; c++, byte += size) {
        uint shift = (byte & 3u) * 8u;
        uint bits = table[nonuniformEXT(a.slot)].words[byte >> 2] >> shift;
        // A component may straddle two words, if the buffer is packed that tightly.
        if (shift + size * 8u > 32u) bits |= table[nonuniformEXT(a.slot)].words[(byte >> 2) + 1u] << (32u - shift);
        value[c] = component_value(a.component, bits);
    }
    return value;
}

vec4 tw_attribute_float(const in uint location) {
    return uintBitsToFloat(fetch(location, floatBitsToUint(1.0)));
}

uvec4 tw_attribute_uint(const in uint location) {
    return fetch(location, 1u);
}

void tw_output(const in uint location, const in uint component, const in uint count, const in uvec4 value) {
    for (uint c = 0u; c < count; c++) varyings[varying_base + location * 4u + component + c] = value[c];
}

// Replaced by the splicer; calls every hook, so that none is optimised away.
void tw_user_main() {
    tw_output(tw_resource(0u), 0u, 4u, tw_attribute_uint(0u) + floatBitsToUint(tw_attribute_float(0u)));
}

uint piece_of_slot(const uint slot) {
    uint low = batch.run_first, high = batch.run_first + batch.run_count - 1u;
    while (low < high) {
        uint middle = (low + high + 1u) >> 1;
        bool after = pieces[runs[middle]].vertex_base > slot;
        low = after ? low : middle;
        high = after ? middle - 1u : high;
    }
    return runs[low];
}

void main() {
    uint i = linear_invocation();
    if (i >= batch.slot_count) return;
    uint slot = batch.slot_first + i;
    Piece piece = pieces[piece_of_slot(slot)];
    uint local = slot - piece.vertex_base;
    uint vertex, instance;
    if (piece.vertex_mode == VERTEX_RANGED) {
        instance = local / piece.vertices_per_instance;
        vertex = piece.vertex_min + local - instance * piece.vertices_per_instance;
        instance += piece.instance_min;
    } else {
        uint primitive = piece.first_in_draw + local / 3u;
        instance = primitive / piece.primitives_per_instance;
        uvec3 element = assemble(piece.topology, primitive - instance * piece.primitives_per_instance);
        vertex = fetch_index(piece, element[local % 3u]);
    }
    tw_VertexIndex = int(vertex) + piece.base_vertex;
    tw_InstanceIndex = int(piece.first_instance + instance);
    tw_BaseVertex = piece.index_slot == NONE ? int(piece.first_element) : piece.base_vertex;
    tw_BaseInstance = int(piece.first_instance);
    tw_DrawIndex = int(piece.draw_id);
    tw_Position = vec4(0.0);
    tw_PointSize = 1.0;
    resource_base = piece.vertex_resources;
    attribute_base = piece.attribute_base;
    varying_base = piece.varying_base + local * piece.varying_stride;
    tw_user_main();
    positions[slot] = tw_Position;
}
