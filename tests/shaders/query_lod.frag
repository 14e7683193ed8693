// refused without native derivatives: textureQueryLod
#version 460
layout(set = 0, binding = 0) uniform sampler2D image;
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;
void main() { color = vec4(textureQueryLod(image, uv), 0.0, 1.0); }
