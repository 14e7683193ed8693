// Specialization constants of every kind, computed ones, and one that is the length of an input.
#version 460
layout(constant_id = 0) const float SCALE = 2.0;
layout(constant_id = 1) const int COUNT = 3;
layout(constant_id = 2) const bool INVERT = false;
layout(constant_id = 3) const uint LENGTH = 2u;
const int TWICE = COUNT * 2;
layout(location = 0) in vec2 list[LENGTH];
layout(location = 0) out vec4 color;
const vec4 TABLE[3] = vec4[](vec4(0.1), vec4(0.2), vec4(0.3));
void main() {
    float values[TWICE];
    for (int i = 0; i < TWICE; i++) values[i] = SCALE * i;
    color = vec4(values[COUNT], list[LENGTH - 1u], 1.0) + TABLE[COUNT % 3];
    if (INVERT) color = 1.0 - color;
}
