// Helpers change no memory: stores, atomics and image writes, in loops, with discard.
#version 460
layout(set = 0, binding = 1, r32ui) uniform uimage2D counts;
layout(set = 0, binding = 2, rgba8) uniform image2D target;
layout(set = 0, binding = 3) buffer Store { uint count; float values[]; } store;
layout(set = 0, binding = 4, rgba16f) writeonly uniform image2DArray layers[2];
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;
void main() {
    float sum = 0.0;
    ivec2 at = ivec2(gl_FragCoord.xy);
    for (int i = 0; i < 8; i++) {
        if (i == int(uv.x)) continue;
        uint r = atomicAdd(store.count, 1u);
        sum += float(r) + float(atomicCompSwap(store.count, 1u, r));
        store.values[r] = uv.x;
        if (sum > 9.0) break;
    }
    do { atomicMax(store.count, 3u); sum += 1.0; } while (sum < 4.0);
    if (uv.x > 0.5) discard;
    uint r = imageAtomicAdd(counts, at, 1u);
    imageStore(target, at, imageLoad(target, at) + vec4(r));
    imageStore(layers[r & 1u], ivec3(at, 1), vec4(sum));
    color = vec4(r > 3u && atomicOr(store.count, 1u) == 0u ? 1.0 : sum);
}
