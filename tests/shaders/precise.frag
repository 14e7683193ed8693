#version 320 es
precision mediump float;
layout(location = 0) in highp vec2 uv;
layout(location = 0) out vec4 color;
layout(set = 0, binding = 0) uniform lowp sampler2D image;
void main() {
    precise float exact = uv.x * uv.y + 1.0;
    color = texture(image, uv) * exact;
}
