// Implicit sampling outside fragment shaders means level 0.
#version 460
layout(set = 0, binding = 0) uniform sampler2D heights;
layout(set = 0, binding = 1) uniform sampler2DShadow shadow;
layout(location = 0) in vec3 position;
void main() {
    float h = texture(heights, position.xy).x + textureProj(heights, position).y;
    gl_Position = vec4(position, h + texture(shadow, position));
}
