// Primitive assembly: which elements of a draw make its `k`th primitive (Vulkan 1.3, chapter 21.1).
#ifndef ASSEMBLY_GLSL
#define ASSEMBLY_GLSL

// The number of vertices of a primitive.
uint corners_of(const uint topology) {
    if (topology < TOPOLOGY_POINT_LIST) return PRIMITIVE_KIND_TRIANGLE;
    return topology == TOPOLOGY_POINT_LIST ? PRIMITIVE_KIND_POINT : PRIMITIVE_KIND_LINE;
}

// Strips swap two of every other triangle to keep the winding. Points and lines repeat their first vertex.
uvec3 assemble(const uint topology, const uint k) {
    if (topology == TOPOLOGY_TRIANGLE_LIST) return 3u * k + uvec3(0u, 1u, 2u);
    uvec3 of_strip = k + uvec3(0u, 1u + (k & 1u), 2u - (k & 1u));
    if (topology == TOPOLOGY_TRIANGLE_STRIP) return of_strip;
    if (topology == TOPOLOGY_TRIANGLE_LIST_WITH_ADJACENCY) return 6u * k + uvec3(0u, 2u, 4u);
    if (topology == TOPOLOGY_TRIANGLE_STRIP_WITH_ADJACENCY) return 2u * of_strip;
    if (topology == TOPOLOGY_TRIANGLE_FAN) return uvec3(k + 1u, k + 2u, 0u);
    if (topology == TOPOLOGY_POINT_LIST) return uvec3(k);
    if (topology == TOPOLOGY_LINE_LIST_WITH_ADJACENCY) return 4u * k + uvec3(1u, 2u, 1u);
    if (topology == TOPOLOGY_LINE_STRIP_WITH_ADJACENCY) return k + uvec3(1u, 2u, 1u);
    return (topology == TOPOLOGY_LINE_LIST ? 2u * k : k) + uvec3(0u, 1u, 0u);
}

// Which of the three is the last one in the draw.
uint last_of(const uint topology, const uint k) {
    if (topology == TOPOLOGY_POINT_LIST) return 0u;
    bool list = topology == TOPOLOGY_TRIANGLE_LIST || topology == TOPOLOGY_TRIANGLE_LIST_WITH_ADJACENCY;
    bool strip = topology == TOPOLOGY_TRIANGLE_STRIP || topology == TOPOLOGY_TRIANGLE_STRIP_WITH_ADJACENCY;
    return list || (strip && (k & 1u) == 0u) ? 2u : 1u;
}

// The primitives of `count` elements.
uint primitives_of(const uint topology, const uint count) {
    uint corners = corners_of(topology);
    if (topology == TOPOLOGY_TRIANGLE_LIST) return count / 3u;
    if (topology == TOPOLOGY_LINE_LIST) return count / 2u;
    if (topology == TOPOLOGY_TRIANGLE_LIST_WITH_ADJACENCY) return count / 6u;
    if (topology == TOPOLOGY_LINE_LIST_WITH_ADJACENCY) return count / 4u;
    if (topology == TOPOLOGY_TRIANGLE_STRIP_WITH_ADJACENCY) return count < 6u ? 0u : (count - 4u) / 2u;
    if (topology == TOPOLOGY_LINE_STRIP_WITH_ADJACENCY) return count < 4u ? 0u : count - 3u;
    return count < corners ? 0u : count - corners + 1u;
}
#endif
