// Atomic: the benchmark measures the rate of the device's atomic additions with it.
//
// Reads and writes: one counter per lane, scattered, so that few lanes meet at the same one.
// Contract: the counters' sum grows by one per lane.
// Kernel / Twin: src/bench/limits.rs; no twin, its time is the result.
#version 460
#extension GL_EXT_scalar_block_layout : require

layout(local_size_x = 64) in;
layout(scalar, binding = 0) buffer Counters { uint counters[]; };

void main() {
    // Odd, so that it permutes the counters, whose number is a power of two.
    uint scattered = gl_GlobalInvocationID.x * 2654435761u;
    atomicAdd(counters[scattered % uint(counters.length())], 1u);
}
