// Half floats, small integers and doubles in arithmetic and memory.
#version 460
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_16bit_storage : require
#extension GL_EXT_shader_8bit_storage : require
layout(set = 0, binding = 0) uniform Small { f16vec4 h; uint16_t s; uint8_t b; } small;
layout(push_constant) uniform Push { f16vec2 p; } push;
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;
void main() {
    f16vec4 h = small.h * float16_t(uv.x) + f16vec4(push.p, push.p);
    double d = double(uv.y) * 2.0lf;
    color = vec4(h) + float(d) + float(small.s + uint16_t(small.b)) + float(int64_t(uv.x));
}
