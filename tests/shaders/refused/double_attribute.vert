// refused: 64 bits
#version 460
layout(location = 0) in dvec3 position;
void main() { gl_Position = vec4(position, 1.0); }
