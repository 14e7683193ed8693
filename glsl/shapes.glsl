// Points and lines in the window: each is a parallelogram, which is rasterized as two triangles.
//
// A point is a square. A rectangular line is a rectangle along the line. A Bresenham line has vertical ends if it is rather flat,
// and horizontal ends if it is rather steep; its ends are moved to where the rule of diamonds wants them (Vulkan 1.3, "Bresenham
// Line Segment Rasterization"). Depth changes along a line alone.
// The file that includes this one declares the buffer `positions` and the push constants `batch`. Twin: src/reference/shape.rs.
#ifndef SHAPES_GLSL
#define SHAPES_GLSL
#include "distances.glsl"
#include "lib/depth.glsl"
#include "lib/window.glsl"

struct Shape {
    ivec2 corners[4]; // in 1/256 pixel from the centre of pixel (0, 0), clockwise on the screen
    vec3 plane;       // of its depths, as `depth_plane` gives it
    uint flags;       // `TRIANGLE_*` of its halves
};

// A place in pixels, in 1/256 pixel from the centre of pixel (0, 0).
ivec2 snap(const vec2 p) {
    const float scale = float(1u << SUBPIXEL_BITS);
    const int half_pixel = 1 << (SUBPIXEL_BITS - 1u);
    // As devices round, whose samples are not in the centres.
    if (batch.reach != 0) return ivec2(round_even(p.x * scale), round_even(p.y * scale)) - half_pixel;
    return ivec2(round_even((p.x - 0.5) * scale), round_even((p.y - 0.5) * scale));
}

// A distance in pixels, in 1/256 pixel.
ivec2 snap_distance(const vec2 d) {
    const float scale = float(1u << SUBPIXEL_BITS);
    return ivec2(round_even(d.x * scale), round_even(d.y * scale));
}

// Cuts a line by the planes of `cut`. Returns whether anything is left.
bool cut_line(inout Corner p, inout Corner q, const uint cut) {
    float tp = 0.0, tq = 0.0;
    for (uint plane = 0u; plane < CLIP_PLANES; plane++) {
        if ((cut & (1u << plane)) == 0u) continue;
        float dp = clip_distance(plane, p), dq = clip_distance(plane, q);
        if (dp < 0.0 && dq < 0.0) return false;
        if (dp < 0.0) tp = max(tp, exact_divide(dp, dp - dq));
        if (dq < 0.0) tq = max(tq, exact_divide(dq, dq - dp));
    }
    if (tp + tq >= 1.0) return false;
    Corner from = p;
    p = from + (q - from) * tp;
    q = q + (from - q) * tq;
    return true;
}

// Whether the value along one axis lies in the half of its pixel that the line from or to it leaves. Signs of zeros count as
// devices take them, which differs between flat and steep lines.
bool is_behind(const bool steep, const float offset, const float along) {
    return steep ? (-offset >= 0.0) == (along >= 0.0) : (offset >= 0.0) == (-along >= 0.0);
}

bool is_aside(const bool steep, const float offset, const float across) {
    return steep ? (offset >= 0.0) != (-across >= 0.0) : (-offset >= 0.0) != (across >= 0.0);
}

// The corners of a Bresenham line from `a` to `b`, which are not the same.
void bresenham(const vec2 a, const vec2 b, const float width, inout Shape shape) {
    bool steep = abs(a.x - b.x) < abs(a.y - b.y);
    // Along the line, then across it.
    vec2 p = steep ? a.yx : a, q = steep ? b.yx : b, d = p - q;
    float slope = exact_divide(flush(d.y), d.x);
    // From the centres of the ends' pixels.
    vec2 op = p - floor(p) - 0.5, oq = q - floor(q) - 0.5;
    if (oq.y == -0.5 && d.y < 0.0) oq.y = 0.5;
    bool start = abs(op.x) + abs(op.y) < 0.5, end = false;
    if (!start && !is_behind(steep, op.x, d.x)) {
        float at = p.y - floor(p.y) + op.x * slope;
        start = is_aside(steep, op.y, d.y) || (at < 1.0 && at > 0.0);
    }
    if (abs(oq.x) + abs(oq.y) >= 0.5 && is_behind(steep, oq.x, d.x)) {
        float at = q.y - floor(q.y) + oq.x * slope;
        end = !is_aside(steep, oq.y, d.y) || (at < 1.0 && (at > 0.0 || (steep && at == 0.0)));
    }
    // An end moves to a side of its pixel where its centre would decide otherwise.
    bool forward = d.x < 0.0;
    vec2 moved = vec2(0.0);
    if ((forward ? op.x <= 0.0 : op.x > 0.0) != start) moved.x = -op.x + (forward ? -0.5 : 0.5);
    if ((forward ? oq.x > 0.0 : oq.x <= 0.0) != end) moved.y = -oq.x + (forward ? -0.5 : 0.5);
    ivec2 from = snap_distance(vec2(p.x + moved.x, p.y + moved.x * slope) - 0.5);
    ivec2 to = snap_distance(vec2(q.x + moved.y, q.y + moved.y * slope) - 0.5);
    ivec2 low = forward ? from : to, high = forward ? to : from;
    int across = round_even(max(width, 1.0)) << (SUBPIXEL_BITS - 1u);
    ivec2 side = ivec2(0, steep ? -across : across);
    shape.corners = ivec2[4](low - side, high - side, high + side, low + side);
    if (steep) {
        for (uint i = 0u; i < 4u; i++) shape.corners[i] = shape.corners[i].yx;
    }
}

// The line between two places of the window. Returns whether it has a length.
bool make_line(const vec3 a, const vec3 b, const float width, const uint mode, inout Shape shape) {
    vec2 d = a.xy - b.xy;
    float squared = flush(d.x * d.x + d.y * d.y);
    if (squared == 0.0) return false;
    vec2 way = d;
    if (mode == LINE_MODE_BRESENHAM) {
        bool steep = abs(d.x) < abs(d.y);
        float slope = exact_divide(flush(steep ? d.x : d.y), steep ? d.y : d.x);
        shape.flags = steep ? TRIANGLE_ALONG_Y : TRIANGLE_ALONG_X;
        way = d * (1.0 + slope * slope) * (steep ? vec2(0.0, 1.0) : vec2(1.0, 0.0));
        bresenham(a.xy, b.xy, width, shape);
    } else {
        float s = exact_divide(width * 0.5, exact_sqrt(squared));
        ivec2 side = snap_distance(vec2(-d.y * s, d.x * s)), from = snap(a.xy), to = snap(b.xy);
        shape.corners = ivec2[4](from + side, to + side, to - side, from - side);
    }
    vec2 gradient = (a.z - b.z) * way * exact_divide(1.0, squared);
    float start = batch.reach != 0 ? 0.0 : 0.5;
    float z = a.z - (gradient.x * (a.x - start) + gradient.y * (a.y - start));
    shape.plane = usable_plane(vec3(gradient, z), a.z);
    return true;
}

// The shape of a primitive of `piece`, whose vertices are in `slots`. `from` and `to` are its window positions. Returns whether
// there is one.
bool make_shape(const Piece piece, const uvec3 slots, const uvec4 from, const uvec4 to, inout Shape shape) {
    uint planes = (piece.fragment_state & DEPTH_STATE_UNCLIPPED) == 0u ? OUT_DEPTHS : 0u, code = from.w | to.w;
    if (piece.topology != TOPOLOGY_POINT_LIST) planes |= OUT_USER;
    if ((code & OUT_UNUSABLE) != 0u || (from.w & to.w & (planes | OUT_BEHIND)) != 0u) return false;
    vec3 a = uintBitsToFloat(from.xyz), b = uintBitsToFloat(to.xyz);
    const float far_out = float(1u << GUARD_LOG2) - 1024.0;
    if (piece.topology == TOPOLOGY_POINT_LIST) {
        // No target reaches so far, and not-a-number is nowhere.
        if (!all(lessThan(abs(a.xy), vec2(far_out)))) return false;
        int side = int(from.w >> OUT_SIDE_SHIFT);
        ivec2 low = snap(a.xy) - side / 2;
        shape.corners = ivec2[4](low, low + ivec2(side, 0), low + side, low + ivec2(0, side));
        shape.plane = vec3(0.0, 0.0, a.z);
        return true;
    }
    // The sides of the viewport do not cut lines: wide lines would get other ends. But a line that reaches far beyond the target
    // is cut by them, and so is one that ends behind the eye, if depth does not cut it there.
    uint cut = code & planes;
    if ((code & OUT_BEHIND) != 0u && (cut & OUT_DEPTHS) == 0u) cut |= code & OUT_SIDES;
    Viewport viewport = Viewport(vec3(piece.scale, piece.depth_scale), vec3(piece.offset, piece.depth_offset));
    bool placed = true;
    for (uint attempt = 0u; attempt < 2u; attempt++) {
        if (cut != 0u) {
            Corner p = corner_at(piece, slots.x), q = corner_at(piece, slots.y);
            if (!cut_line(p, q, cut)) return false;
            placed = flush(POSITION(p).w) > 0.0 && flush(POSITION(q).w) > 0.0;
            if (placed) a = window_position(viewport, POSITION(p), (from.w & OUT_PLANES) != 0u);
            if (placed) b = window_position(viewport, POSITION(q), (to.w & OUT_PLANES) != 0u);
        }
        if (placed && all(lessThan(abs(vec4(a.xy, b.xy)), vec4(far_out)))) break;
        cut |= code & OUT_SIDES;
    }
    return placed && make_line(a, b, piece.line_width, piece.line_mode, shape);
}
#endif
