// Vertex: runs the user's vertex shader once for each vertex slot.
//
// Reads: pieces, index buffers, vertex buffers and whatever the shader binds.
// Writes: the clip-space position and the varyings of each slot; its window position and outcode.
// Contract: slot `s` holds the outputs that the graphics pipeline's vertex stage would give for that vertex
// and instance; the stage stores nothing else. Window positions are those of `lib/window.glsl`; where the
// outcode says that there is none, they hold any value.
// Kernel / Twin: src/compute/vertex.rs; no twin, the shader is the user's.
//
// The shader is spliced into `tw_user_bind` and `tw_user_main`; it sees the functions and globals called
// tw_*. An invocation takes VERTEX_ROUNDS slots, one after the other. Most of them belong to the same piece,
// so that its fields, attributes and uniforms are fetched once. Window position and outcode depend on the
// vertex alone, so they are computed here: in a closed mesh each vertex belongs to six triangles, and
// computing them once for each triangle was a third of the primitive stage.
#version 460
#include "pieces.glsl"
#include "lib/quad.glsl"
#include "lib/window.glsl"

layout(constant_id = SPEC_LANES) const uint LANES = 64u;
layout(constant_id = SPEC_READ) const uint READ = 0xffffffffu;
layout(local_size_x_id = SPEC_LANES) in;
layout(scalar, binding = 0) readonly buffer Pieces { QuadPiece pieces[]; };
layout(scalar, binding = 1) writeonly buffer Positions { vec4 positions[]; };
layout(scalar, binding = 2) writeonly buffer Varyings { uvec4 varyings[]; };
layout(scalar, binding = 4) readonly buffer ResourceSlots { uint resource_slots[]; };
// Pieces in the order of their vertex slots.
layout(scalar, binding = 5) readonly buffer Runs { uint runs[]; };
// Window position as bits, and the outcode; of points, the side of their square comes above it.
layout(scalar, binding = 6) writeonly buffer WindowPositions { uvec4 window_positions[]; };

int tw_VertexIndex, tw_InstanceIndex, tw_BaseVertex, tw_BaseInstance, tw_DrawIndex;
vec4 tw_Position;
float tw_PointSize;

Piece piece;
Viewport viewport;
uint varying_base;

#include "attributes.glsl"

uint tw_resource(const in uint i) {
    return resource_slots[piece.vertex_resources + i];
}

uvec4 tw_block_words(const in uint slot, const in uint word, const in uint last) {
    return of_quad(table[nonuniformEXT(slot)].words[min(word + QUAD_LANE, last)]);
}

void tw_output(const in uint location, const in uint component, const in uint count, const in uvec4 value) {
    bool distance = location >= DISTANCE_LOCATION;
    if (!distance && (location >= MAX_VARYINGS || (READ >> location & 1u) == 0u)) return;
    // Distances come last.
    uint at = distance ? piece.varying_stride / 4u - DISTANCE_LOCATIONS + location - DISTANCE_LOCATION : location;
    if (count == 4u) {
        varyings[varying_base + at] = value;
    } else {
        for (uint c = 0u; c < count; c++) varyings[varying_base + at][component + c] = value[c];
    }
}

// The splicer replaces these bodies. They call every hook, so that the compiler keeps all hooks.
void tw_user_bind() {
    tw_bind_attribute(tw_block_words(tw_resource(0u), 0u, 0u).x);
}

void tw_user_bind_instance() {
    tw_bind_instance_attribute(0u);
}

void tw_user_main() {
    tw_output(0u, 0u, 4u, tw_attribute_uint(0u) + floatBitsToUint(tw_attribute_float(0u)));
}

// The index in `runs` of the piece that holds `slot`.
uint run_of_slot(const uint slot) {
    uint low = batch.run_first, high = batch.run_first + batch.run_count - 1u;
    while (low < high) {
        uint middle = (low + high + 1u) >> 1;
        bool after = pieces[runs[middle]].vertices.z > slot;
        low = after ? low : middle;
        high = after ? middle - 1u : high;
    }
    return low;
}

// Binds the piece `index` for the slots that follow; all lanes of a quad call this together.
void bind(const uint index) {
    uvec4 numbers = of_quad(pieces[index].numbers[QUAD_LANE]);
    uvec4 vertices = of_quad(pieces[index].vertices[QUAD_LANE]);
    uvec4 elements = of_quad(pieces[index].elements[QUAD_LANE]);
    uvec4 indices = of_quad(pieces[index].indices[QUAD_LANE]);
    uvec4 stage = of_quad(pieces[index].stage[QUAD_LANE]);
    piece.first_in_draw = numbers.x;
    piece.primitives_per_instance = numbers.y;
    piece.varying_base = vertices.x;
    piece.varying_stride = vertices.y;
    piece.vertex_base = vertices.z;
    piece.vertex_slots = vertices.w;
    piece.topology = elements.x;
    piece.first_element = elements.y;
    piece.index_slot = elements.z;
    piece.index_bytes = elements.w;
    piece.base_vertex = int(indices.x);
    piece.first_instance = indices.y;
    piece.vertex_mode = indices.z;
    piece.vertex_min = indices.w;
    piece.vertices_per_instance = stage.x;
    piece.instance_min = stage.y;
    piece.attribute_base = stage.z;
    piece.vertex_resources = stage.w;
    piece.draw_id = pieces[index].draw_id;
    vec4 in_pixels = uintBitsToFloat(of_quad(pieces[index].viewport[QUAD_LANE]));
    viewport.scale = vec3(in_pixels.xy, pieces[index].depth_scale);
    viewport.offset = vec3(in_pixels.zw, pieces[index].depth_offset);
    tw_user_bind();
    bound_instance = NONE;
}

// Binds the per-instance attributes of `instance`, an instance of the bound piece's draw. Most vertices find it bound
// already. The second branch is there for lavapipe, which jumps over a branch only if it contains another one.
void bind_instance(const uint instance) {
    [[dont_flatten]] if (instance != bound_instance) {
        bound_instance = instance;
        [[dont_flatten]] if (instance != NONE) tw_user_bind_instance();
    }
}

void main() {
    uint lane = gl_SubgroupID * gl_SubgroupSize + gl_SubgroupInvocationID;
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint first = batch.slot_first + group * LANES * VERTEX_ROUNDS + lane;
    uint end = batch.slot_first + batch.slot_count; // a multiple of QUAD: quads stay together
    uint piece_end = 0u; // the first slot after those of the bound piece
    [[dont_unroll]] for (uint round = 0u; round < VERTEX_ROUNDS; round++) {
        // Lanes beyond the end bind a piece too: a driver may access the table slot of a lane even while the
        // lane is switched off.
        uint slot = min(first + round * LANES, end - QUAD + QUAD_LANE);
        if (slot >= piece_end) {
            uint run = run_of_slot(slot);
            piece_end = end;
            if (run + 1u < batch.run_first + batch.run_count) piece_end = pieces[runs[run + 1u]].vertices.z;
            bind(runs[run]);
        }
        if (first + round * LANES >= end) break;
        uint local = slot - piece.vertex_base;
        if (local < piece.vertex_slots) {
            uint vertex, instance;
            if (piece.vertex_mode == VERTEX_RANGED) {
                instance = divide(local, piece.vertices_per_instance);
                vertex = piece.vertex_min + local - instance * piece.vertices_per_instance;
                instance += piece.instance_min;
            } else {
                bool in_quads = piece.vertex_mode == VERTEX_PER_QUAD;
                // Divisions by constants, which are none.
                uint corners = corners_of(piece.topology);
                uint own = corners == 3u ? local / 3u : (corners == 2u ? local / 2u : local);
                uint corner = in_quads ? min(local & 3u, 2u) : local - own * corners;
                uint primitive = piece.first_in_draw + (in_quads ? local >> 2 : own);
                instance = divide(primitive, piece.primitives_per_instance);
                uvec3 element = assemble(piece.topology, primitive - instance * piece.primitives_per_instance);
                vertex = fetch_index(piece, element[corner]);
            }
            tw_VertexIndex = int(vertex) + piece.base_vertex;
            tw_InstanceIndex = int(piece.first_instance + instance);
            tw_BaseVertex = piece.index_slot == NONE ? int(piece.first_element) : piece.base_vertex;
            tw_BaseInstance = int(piece.first_instance);
            tw_DrawIndex = int(piece.draw_id);
            tw_Position = vec4(0.0);
            tw_PointSize = 1.0;
            varying_base = (piece.varying_base + local * piece.varying_stride) >> 2;
            bind_instance(instance);
            tw_user_main();
            positions[slot] = tw_Position;
            vec4 p = sanitized(tw_Position);
            uint code = outcode(p);
            if (piece.topology == TOPOLOGY_POINT_LIST) code |= point_side(tw_PointSize) << OUT_SIDE_SHIFT;
            window_positions[slot] = uvec4(floatBitsToUint(window_position(viewport, p, false)), code);
        }
    }
}
