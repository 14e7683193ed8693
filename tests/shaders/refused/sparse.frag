// refused: SparseResidency
#version 460
#extension GL_ARB_sparse_texture2 : require
layout(set = 0, binding = 0) uniform sampler2D image;
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;
void main() { sparseTextureARB(image, uv, color); }
