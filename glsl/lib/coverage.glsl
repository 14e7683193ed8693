// Which pixels a triangle covers. Raster and ordered ask here for every pixel of a bin, unless a triangle has the
// whole bin inside of its edges.
#ifndef COVERAGE_GLSL
#define COVERAGE_GLSL

// Whether a triangle covers all pixels of a bin that lies inside of all its edges. Otherwise, each pixel of such a bin
// is asked for as well, which takes longer.
const bool COVERS_WHOLE_BINS = true;

// Whether the triangle covers the target's pixel `pixel`, where its three edges have the values `edges`: an edge has 0
// or more at the pixels that are on the inner side of it, or on it if it is a top or left edge.
bool covered(const ivec3 edges, const ivec2 pixel) {
    return (edges.x | edges.y | edges.z) >= 0;
}
#endif
