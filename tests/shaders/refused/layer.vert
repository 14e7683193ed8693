// refused: Layer
#version 460
#extension GL_ARB_shader_viewport_layer_array : require
void main() { gl_Position = vec4(0.0); gl_Layer = 1; }
