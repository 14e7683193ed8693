// Never dispatched: glsl/tool reads the layout of every shared struct from it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "abi.glsl"
layout(scalar, binding = 0) buffer Batches { Batch batches[]; };
layout(scalar, binding = 1) buffer Pieces { Piece pieces[]; };
layout(scalar, binding = 2) buffer Attributes { Attribute attributes[]; };
layout(scalar, binding = 3) buffer Triangles { Triangle triangles[]; };
layout(scalar, binding = 4) buffer Clears { Clear clears[]; };
layout(scalar, binding = 8) buffer Narrows { Narrow narrows[]; };
layout(scalar, binding = 5) buffer QuadPieces { QuadPiece quad_pieces[]; };
layout(scalar, binding = 7) buffer CommandLists { Commands command_lists[]; };
layout(scalar, binding = 6) buffer QuadTriangles { QuadTriangle quad_triangles[]; };
void main() {
    batches[0].width = pieces[0].first_primitive + attributes[0].slot + triangles[0].flags + clears[0].count + narrows[0].pixels
        + quad_pieces[0].cull + command_lists[0].draws + quad_triangles[0].raster[0].x;
}
