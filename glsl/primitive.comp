// Primitive: assembles, clips, culls and sets up every primitive of a batch.
//
// Reads: pieces, index buffers, window positions and outcodes; clip-space positions of primitives that
// are clipped; WITH_DISTANCES, varyings, among which the distances are.
// Writes: the triangle of each primitive, or several if it is clipped; counts of the cells; for each
// primitive the cell that lists it, NONE or SEVERAL_CELLS.
// Contract: the triangles of a primitive cover exactly the samples inside it and inside the
// clip volume, viewport and scissor, by the top-left rule; two triangles that share an edge share no
// pixel and leave none out. A primitive that draws nothing writes no triangle; if the batch is traced, it
// writes a triangle that is not TRIANGLE_VALID.
// Kernel / Twin: src/compute/primitive.rs, src/reference/primitive.rs.
//
// An invocation takes PRIMITIVE_ROUNDS primitives, one after the other. Most of them belong to the same
// piece, so that its fields are fetched once.
#version 460
#ifdef CLIP_BY_DISTANCES
#define WITH_DISTANCES
#endif
#include "pieces.glsl"
#include "lib/cells.glsl"
const bool ADJUSTED = true;
const uint DEPTH_BITS = 0u;
#include "lib/depth.glsl"
#include "lib/window.glsl"

layout(local_size_x = GROUP) in;
layout(scalar, binding = 0) readonly buffer Pieces { Piece pieces[]; };
layout(scalar, binding = 1) readonly buffer Positions { vec4 positions[]; };
layout(scalar, binding = 2) readonly buffer WindowPositions { uvec4 window_positions[]; };
layout(scalar, binding = 3) writeonly buffer Triangles { QuadTriangle triangles[]; };
layout(scalar, binding = 4) buffer CellCounts { uint cell_counts[]; };
layout(scalar, binding = 5) writeonly buffer PrimitiveCells { uint primitive_cells[]; };

#ifdef WITH_DISTANCES
layout(scalar, binding = 6) readonly buffer Varyings { uvec4 varyings[]; };
#endif
#include "shapes.glsl"
#include "slots.glsl"

void store_flags(const uint at, const uint flags) {
    triangles[at].shading[3].y = flags;
}

// Sets up one triangle, stores it at `at` with `more` among its flags, and returns the cell that lists it,
// NONE or SEVERAL_CELLS. A triangle that draws nothing gets no TRIANGLE_VALID. It is stored only if it is
// `part` of a clipped primitive or the batch is traced: half of a mesh shows its back, and large meshes are
// limited by memory. If there is a `shape`, the triangle is the half `half_shape` of it, 1 or 2.
uint set_up(const uint at, const bool part, const uint more, const Piece piece, const uint piece_index, const uvec3 slots, const vec3 a, const vec3 b, const vec3 c, const Shape shape, const uint half_shape) {
    ivec2 sa = snap(a.xy), sb = snap(b.xy), sc = snap(c.xy);
    bool shaped = half_shape != 0u;
    if (shaped) {
        sa = shape.corners[0];
        sb = shape.corners[half_shape];
        sc = shape.corners[half_shape + 1u];
    }
    int turn = wide_sign(wide_subtract(wide_product(sb.x - sa.x, sc.y - sa.y), wide_product(sc.x - sa.x, sb.y - sa.y)));
    bool front = shaped || (turn > 0) == (piece.front_face == FRONT_FACE_CLOCKWISE);
    // Ends of a short line may have passed each other.
    bool drawn = shaped ? turn > 0 : turn != 0 && piece.cull != (front ? CULL_FRONT : CULL_BACK);
    if (turn < 0) {
        ivec2 swap = sb;
        sb = sc;
        sc = swap;
    }
    // Pixels of which a sample may lie in the box of the corners: left and top sides included, the others not.
    ivec2 low = (min(sa, min(sb, sc)) - batch.reach + ((1 << SUBPIXEL_BITS) - 1)) >> SUBPIXEL_BITS;
    ivec2 high = (max(sa, max(sb, sc)) + batch.reach - 1) >> SUBPIXEL_BITS;
    low = max(low, piece.rect_min);
    high = min(high, piece.rect_max);
    if (!drawn || low.x > high.x || low.y > high.y) {
        if (part || batch.traced != 0u) store_flags(at, more);
        return NONE;
    }

    vec3 plane = shape.plane;
    [[dont_flatten]] if (!shaped) plane = depth_plane(a, b, c, batch.reach != 0 ? 0.0 : 0.5);
    uint adjusted = 0u;
    if ((piece.fragment_state & DEPTH_STATE_ADJUSTED) != 0u) {
        float largest = shaped ? 0.0 : max(abs(a.z), max(abs(b.z), abs(c.z)));
        adjusted = TRIANGLE_ADJUSTED | floatBitsToUint(largest) >> 23 << TRIANGLE_EXPONENT_SHIFT;
    }
    uint flags = adjusted | (shaped ? shape.flags : 0u) | TRIANGLE_VALID | (front ? TRIANGLE_FRONT : 0u) | (piece.cut != 0u ? TRIANGLE_CUT : 0u);
    uvec2 first = uvec2(low - ivec2(0, int(batch.origin_y))), last = uvec2(high - ivec2(0, int(batch.origin_y)));
    ivec3 x = ivec3(sa.x, sb.x, sc.x), y = ivec3(sa.y, sb.y, sc.y);
    uint level = cell_level(x, y, first, last, batch.origin_y, batch.reach);
    flags |= level << TRIANGLE_LEVEL_SHIFT;

    triangles[at].raster[0] = uvec2(x.xy);
    triangles[at].raster[1] = uvec2(x.z, first.x | first.y << 16);
    triangles[at].raster[2] = uvec2(y.xy);
    triangles[at].raster[3] = uvec2(y.z, last.x | last.y << 16);
    triangles[at].shading[0] = floatBitsToUint(plane.zx);
    triangles[at].shading[1] = uvec2(floatBitsToUint(plane.y), piece_index);
    triangles[at].shading[2] = slots.xy;
    triangles[at].shading[3] = uvec2(slots.z, flags | more);

    uvec4 range = cells_under(level, first, last);
    uint cell = 0u;
    for (uint row = range.y; row <= range.w; row++) {
        for (uint column = range.x; column <= range.z; column++) {
            if (!cell_lists(x, y, level, range, uvec2(column, row), batch.origin_y, batch.reach)) continue;
            cell = batch.cell_first[level] + row * batch.cell_columns[level] + column;
            atomicAdd(cell_counts[cell], 1u);
        }
    }
    return range.xy == range.zw ? cell : SEVERAL_CELLS;
}

// Records for a trace that the primitive draws nothing.
void store_nothing(const uint primitive) {
    if (batch.traced != 0u) store_flags(primitive, 0u);
}

// Processes one primitive; returns the cell that lists it, NONE or SEVERAL_CELLS.
uint run(const uint primitive, const uint piece_index, const Piece piece) {
    uvec3 slots = vertex_slots(piece, primitive - piece.first_primitive);
    uvec4 a = window_positions[slots.x], b = window_positions[slots.y], c = window_positions[slots.z];

    Verdict verdict = judge(piece, slots);
    if (piece.topology != TOPOLOGY_POINT_LIST) {
        a.w |= verdict.outside.x;
        b.w |= verdict.outside.y;
        c.w |= verdict.outside.z;
    }
    Shape shape;
    shape.flags = 0u;
    bool shaped = piece.topology >= TOPOLOGY_POINT_LIST;
    [[dont_flatten]] if (shaped) {
        if (verdict.hidden || !make_shape(piece, slots, a, b, shape)) {
            store_nothing(primitive);
            return NONE;
        }
        // Nothing is left to clip.
        a.w = 0u;
        b.w = 0u;
        c.w = 0u;
    }
    // A primitive that lies wholly outside one plane of the view volume draws nothing; it need not be clipped.
    uint planes = (piece.fragment_state & DEPTH_STATE_UNCLIPPED) == 0u ? OUT_PLANES : OUT_PLANES & ~OUT_DEPTHS;
    uint code = (a.w | b.w | c.w) & (planes | OUT_BEHIND | OUT_UNUSABLE), count = 3u, made = 0u;
    if (verdict.hidden || (a.w & b.w & c.w & planes) != 0u || (code & OUT_UNUSABLE) != 0u) {
        store_nothing(primitive);
        return NONE;
    }
    bool clipped = code != 0u;
    if (shaped) count = 4u;
    Corner corners[CLIP_CORNERS];
    if (clipped) {
        for (uint i = 0u; i < 3u; i++) corners[i] = corner_at(piece, slots[i]);
        count = clip_polygon(corners, code & OUT_PLANES, made);
        // A clipped corner has w = 0 only if it lies at the eye, which has no window position.
        bool drawable = count >= 3u;
        for (uint i = 0u; i < count; i++) drawable = drawable && flush(POSITION(corners[i]).w) > 0.0;
        if (!drawable) {
            store_nothing(primitive);
            return NONE;
        }
    }
    // Clipped and whole triangles share one loop with one call, so that the code is compiled once.
    Viewport viewport = Viewport(vec3(piece.scale, piece.depth_scale), vec3(piece.offset, piece.depth_offset));
    uint cell = NONE, provoking = provoking_vertex(piece, primitive - piece.first_primitive);
    vec3 first = uintBitsToFloat(a.xyz), previous = uintBitsToFloat(b.xyz);
    [[dont_unroll]] for (uint i = clipped ? 0u : 2u; i < count; i++) {
        vec3 next = uintBitsToFloat(c.xyz);
        // Indexing by a variable costs CPUs a hundred instructions; the branch skips it unless a lane clips.
        [[dont_flatten]] if (clipped) next = window_position(viewport, POSITION(corners[i]), ((made >> i) & 1u) != 0u);
        if (i == 0u) first = next;
        if (i >= 2u) {
            uint part = i - 2u;
            uint at = part * batch.primitives + primitive;
            uint more = provoking << TRIANGLE_PROVOKING_SHIFT | (part == 0u ? (count - 3u) << TRIANGLE_EXTRA_SHIFT : 0u);
            cell = set_up(at, count > 3u, more, piece, piece_index, slots, first, previous, next, shape, shaped ? part + 1u : 0u);
        }
        previous = next;
    }
    return count > 3u ? SEVERAL_CELLS : cell;
}

void main() {
    uint first = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    first = first * GROUP * PRIMITIVE_ROUNDS + gl_LocalInvocationIndex;
    uint piece_end = 0u, piece_index; // `piece_end`: the first primitive after those of the bound piece
    Piece piece;
    [[dont_unroll]] for (uint round = 0u; round < PRIMITIVE_ROUNDS; round++) {
        // Lanes beyond the end bind a piece too: a driver may access the index buffer of a lane even while
        // the lane is switched off.
        uint primitive = min(first + round * GROUP, batch.primitives - 1u);
        if (primitive >= piece_end) {
            piece_index = piece_of_primitive(primitive);
            piece_end = batch.primitives;
            if (piece_index + 1u < batch.piece_first + batch.piece_count) {
                piece_end = pieces[piece_index + 1u].first_primitive;
            }
            piece = pieces[piece_index];
        }
        if (first + round * GROUP >= batch.primitives) break;
        primitive_cells[primitive] = run(primitive, piece_index, piece);
    }
}
