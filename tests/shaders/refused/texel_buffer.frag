// refused: samplerBuffer
#version 460
layout(set = 0, binding = 0) uniform samplerBuffer words;
layout(location = 0) out vec4 color;
void main() { color = texelFetch(words, 3); }
