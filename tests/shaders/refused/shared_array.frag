// refused: an array of resources as a value
#version 460
layout(set = 0, binding = 0) uniform sampler2D images[3];
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;
vec4 all(sampler2D list[3]) { return texture(list[0], uv) + texture(list[2], uv); }
void main() { color = all(images); }
