// Arrays of resources as arguments, handed on, and several at once.
#version 460
layout(set = 0, binding = 0) uniform sampler2D images[3];
layout(set = 0, binding = 1) uniform sampler2D others[3];
layout(set = 0, binding = 2) uniform texture2D textures[2];
layout(set = 0, binding = 3) uniform sampler samplers[2];
layout(location = 0) in vec2 uv;
layout(location = 1) flat in int which;
layout(location = 0) out vec4 color;
vec4 one(sampler2D list[3], int n) { return texture(list[n], uv); }
vec4 all(float scale, sampler2D list[3]) { return scale * (one(list, which) + texture(list[2], uv)); }
vec4 pair(texture2D t[2], sampler s[2]) { return texture(sampler2D(t[which], s[1 - which]), uv); }
void main() { color = all(2.0, images) + all(3.0, others) + pair(textures, samplers) + one(images, 0); }
