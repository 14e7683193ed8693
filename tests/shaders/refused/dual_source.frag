// refused: location 1 and index 1
#version 460
layout(location = 0) out vec4 color;
layout(location = 1, index = 1) out vec4 other;
void main() { color = vec4(1.0); other = vec4(0.5); }
