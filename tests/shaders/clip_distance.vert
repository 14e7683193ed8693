#version 460
layout(location = 0) in vec3 position;
out gl_PerVertex { vec4 gl_Position; float gl_ClipDistance[2]; };
void main() { gl_Position = vec4(position, 1.0); gl_ClipDistance[0] = position.x; }
