// refused: 16 bits
#version 460
#extension GL_EXT_shader_16bit_storage : require
#extension GL_EXT_shader_explicit_arithmetic_types_float16 : require
layout(location = 0) in f16vec4 h;
layout(location = 0) out vec4 color;
void main() { color = vec4(h); }
