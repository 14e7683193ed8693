// Copy: the benchmark measures the bandwidth of the device's memory with it.
//
// Reads: every word of the source. Writes: the same words of the target.
// Contract: the target holds the source; each lane moves 16 bytes.
// Kernel / Twin: src/bench/limits.rs; no twin, its time is the result.
#version 460
#extension GL_EXT_scalar_block_layout : require

layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer From { uvec4 from[]; };
layout(scalar, binding = 1) writeonly buffer To { uvec4 to[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    to[i] = from[i];
}
