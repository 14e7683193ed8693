// Attributes of every kind: vectors, integers, a matrix (four locations), packed components.
#version 460
layout(location = 0) in vec3 position;
layout(location = 1) in uvec4 joints;
layout(location = 2) in mat4 model;
layout(location = 6, component = 1) in vec2 packed;
layout(location = 6, component = 0) in float single;
layout(location = 7) in ivec2 signed_pair;
layout(location = 8) in float weights[3];
invariant gl_Position;
void main() {
    vec4 sum = vec4(joints) + vec4(signed_pair, packed) * single;
    gl_Position = model * vec4(position, 1.0) + sum * weights[joints.x % 3u];
}
