// Which piece a primitive belongs to, and where its vertices are.
//
// The file that includes this one includes `pieces.glsl` and declares the buffer `pieces`.
#ifndef SLOTS_GLSL
#define SLOTS_GLSL

// The piece that holds the batch's primitive `primitive`.
uint piece_of_primitive(const uint primitive) {
    uint low = batch.piece_first, high = batch.piece_first + batch.piece_count - 1u;
    while (low < high) {
        uint middle = (low + high + 1u) >> 1;
        bool after = pieces[middle].first_primitive > primitive;
        low = after ? low : middle;
        high = after ? middle - 1u : high;
    }
    return low;
}

uvec3 vertex_slots(const Piece piece, const uint in_piece) {
    if (piece.vertex_mode != VERTEX_RANGED) {
        uint corners = corners_of(piece.topology), step = piece.vertex_mode == VERTEX_PER_QUAD ? QUAD : corners;
        return piece.vertex_base + step * in_piece + uvec3(0u, corners > 1u ? 1u : 0u, corners > 2u ? 2u : 0u);
    }
    uint q = piece.first_in_draw + in_piece;
    uint instance = divide(q, piece.primitives_per_instance);
    uvec3 element = assemble(piece.topology, q - instance * piece.primitives_per_instance);
    uvec3 vertex = uvec3(fetch_index(piece, element.x), fetch_index(piece, element.y), fetch_index(piece, element.z));
    // An index outside the range that the caller declared is some vertex of the range.
    vertex = min(vertex - piece.vertex_min, uvec3(piece.vertices_per_instance - 1u));
    return piece.vertex_base + (instance - piece.instance_min) * piece.vertices_per_instance + vertex;
}

// Which of the three vertices of a primitive gives its flat inputs.
uint provoking_vertex(const Piece piece, const uint in_piece) {
    if ((piece.fragment_state & FRAGMENT_STATE_PROVOKED_LAST) == 0u) return 0u;
    uint q = piece.first_in_draw + in_piece;
    return last_of(piece.topology, q - divide(q, piece.primitives_per_instance) * piece.primitives_per_instance);
}
#endif
