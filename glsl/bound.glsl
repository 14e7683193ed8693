// The state that the shading kernels keep bound: a piece, and the triangle that a quad shades.
//
// The four lanes of a quad need the same words and share the work of fetching them (`lib/quad.glsl`). If
// the next quad has the same piece or triangle, nothing is fetched again.
#ifndef BOUND_GLSL
#define BOUND_GLSL
#extension GL_EXT_nonuniform_qualifier : require
#include "abi.glsl"
layout(constant_id = SPEC_ADJUSTED) const bool ADJUSTED = false;
layout(constant_id = SPEC_DEPTH_BITS) const uint DEPTH_BITS = 0u;
layout(constant_id = SPEC_PRIMITIVES) const uint PRIMITIVES = PRIMITIVE_KIND_TRIANGLE;
#include "lib/depth.glsl"
#include "lib/interpolate.glsl"
#include "lib/key.glsl"
#include "lib/quad.glsl"

layout(push_constant, scalar) uniform BatchBlock { Batch batch; };
layout(scalar, binding = 0) readonly buffer Pieces { QuadPiece pieces[]; };
layout(scalar, binding = 1) readonly buffer Triangles { QuadTriangle triangles[]; };
layout(scalar, binding = 2) readonly buffer Positions { uvec2 positions[][2]; };
layout(scalar, binding = 3) readonly buffer Varyings { uvec2 varyings[]; };
layout(scalar, binding = 4) readonly buffer ResourceSlots { uint resource_slots[]; };

layout(scalar, set = SET_TABLE, binding = TABLE_BUFFERS) readonly buffer Words { uint words[]; } table[];

// The piece that was bound last, the fields of it that shading needs, and the first of its shader's resources.
uint bound_piece = NONE;
uint bound_resources = NONE;
vec2 viewport_scale, viewport_offset; // in pixels
uint first_in_draw, primitives_per_instance;
uint piece_varyings, piece_vertices, varying_stride;

// The triangle that a quad shades, with the fields that shading needs.
struct Bound {
    uint key;
    vec3 plane; // depth at the pixel (0, 0), its change to the right and down
    vec3 adjustment;
    uint flags;
    vec3 x, y, w; // clip-space positions of its vertices, of a triangle the nearest first, times `scale`
    float scale;
    float side; // of a point's square, in 1/256 pixel
};

Bound bound = Bound(0u, vec3(0.0), NO_ADJUSTMENT, 0u, vec3(0.0), vec3(0.0), vec3(0.0), 1.0, 0.0);

// Distances come after all other varyings.
const uint INPUT_LOCATIONS = MAX_VARYINGS + DISTANCE_LOCATIONS;

// The index below of what is bound at `location`.
uint input_index(const uint location) {
    return location < DISTANCE_LOCATION ? location : MAX_VARYINGS + location - DISTANCE_LOCATION;
}

// Varyings, bound two locations at a time: the quad's first two lanes hold the words of the even location, two words
// each, and its last two lanes those of the odd one. Each array has this lane's first word at the even location and
// its second word at the odd one. A compiler drops a word that nothing reads.
uvec3 parts[INPUT_LOCATIONS];    // as `differences` of `lib/interpolate.glsl` returns them
uint provoking[INPUT_LOCATIONS]; // for flat varyings
uvec3 varying_base;           // index of each vertex's first pair of words, the nearest vertex first
uint provoking_base;

// Replaced by the splicer.
void tw_user_bind();
void tw_user_bind_inputs();

// Binds a piece and its resources for the calls that follow. Most calls find them bound already, so that
// many fragments share one fetch.
void bind(const uint piece) {
    if (piece == bound_piece) return;
    bound_piece = piece;
    vec4 viewport = uintBitsToFloat(of_quad(pieces[piece].viewport[QUAD_LANE]));
    viewport_scale = viewport.xy;
    viewport_offset = viewport.zw;
    uvec4 numbers = of_quad(pieces[piece].numbers[QUAD_LANE]);
    first_in_draw = numbers.x - numbers.z;
    primitives_per_instance = numbers.y;
    uvec4 vertices = of_quad(pieces[piece].vertices[QUAD_LANE]);
    piece_varyings = vertices.x;
    varying_stride = vertices.y;
    piece_vertices = vertices.z;
    if (numbers.w == bound_resources) return;
    bound_resources = numbers.w;
    tw_user_bind();
}

// Binds the triangle of `key` for the hooks that follow, and returns it; all four lanes of a quad call this
// together. The quads of a large triangle follow each other and find it bound already.
Bound bind_triangle(const uint key) {
    if (key == bound.key) return bound;
    uvec2 own = triangles[key_triangle(key, batch.primitives)].shading[QUAD_LANE];
    uvec4 fields = of_first_half(own), vertices = of_second_half(own);
    // Two lanes load each of the first two vertices, and all lanes load the third one too. The even lane of a
    // pair loads x and y, the odd one z and w; z is not used.
    uint half_vertex = QUAD_LANE & 1u;
    vec2 of_two = uintBitsToFloat(positions[QUAD_LANE < 2u ? vertices.x : vertices.y][half_vertex]);
    vec2 of_third = uintBitsToFloat(positions[vertices.z][half_vertex]);
    float largest = max(abs(of_two.y), abs(of_third.y));
    if (half_vertex == 0u) largest = max(largest, max(abs(of_two.x), abs(of_third.x)));
    largest = max(largest, subgroupQuadSwapHorizontal(largest));
    float scale = scale_for(max(largest, subgroupQuadSwapVertical(largest)));
    uvec2 two = floatBitsToUint(of_two * scale), third = floatBitsToUint(of_third * scale);
    vec4 a = uintBitsToFloat(of_first_half(two)), b = uintBitsToFloat(of_second_half(two));
    vec4 c = uintBitsToFloat(of_first_half(third));
    vec3 w = vec3(a.w, b.w, c.w);
    // Of points and lines, the first vertex comes again as the last.
    uint first = PRIMITIVES == PRIMITIVE_KIND_TRIANGLE ? nearest(w) : 0u;
    float side = 0.0;
    if (PRIMITIVES == PRIMITIVE_KIND_POINT) {
        uvec2 x = triangles[key_triangle(key, batch.primitives)].raster[0];
        side = float(int(x.y - x.x));
    }
    vec3 plane = uintBitsToFloat(fields.xyz);
    vec3 adjustment = NO_ADJUSTMENT;
    if (ADJUSTED && (vertices.w & TRIANGLE_ADJUSTED) != 0u) {
        float bias = bias_of(pieces[fields.w].depth_bias, plane.yz, vertices.w >> TRIANGLE_EXPONENT_SHIFT);
        adjustment = vec3(bias, pieces[fields.w].depth_limits);
    }
    bound = Bound(key, plane, adjustment, vertices.w, corners_from(first, vec3(a.x, b.x, c.x)),
                  corners_from(first, vec3(a.y, b.y, c.y)), corners_from(first, w), scale, side);
    bind(fields.w);
    uvec3 base = (piece_varyings + (vertices.xyz - piece_vertices) * varying_stride) >> 1;
    varying_base = corners_from(first, base);
    provoking_base = base[(vertices.w >> TRIANGLE_PROVOKING_SHIFT) & 3u];
    tw_user_bind_inputs();
    return bound;
}
#endif
