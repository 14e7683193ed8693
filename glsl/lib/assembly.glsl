// Primitive assembly: which elements of a draw make its `k`th primitive (Vulkan 1.3, chapter 21.1).
#ifndef ASSEMBLY_GLSL
#define ASSEMBLY_GLSL

// The provoking vertex comes first; strips swap two of every other triangle to keep the winding.
uvec3 assemble(const uint topology, const uint k) {
    if (topology == TOPOLOGY_TRIANGLE_LIST) return 3u * k + uvec3(0u, 1u, 2u);
    if (topology == TOPOLOGY_TRIANGLE_STRIP) return k + uvec3(0u, 1u + (k & 1u), 2u - (k & 1u));
    return uvec3(k + 1u, k + 2u, 0u);
}
#endif
