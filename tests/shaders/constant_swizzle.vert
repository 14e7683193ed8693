#version 450
// Operations on specialization constants that take any number of literals: a swizzle, an element.
layout(constant_id = 201) const int a = 10;
const ivec4 v = ivec4(20, 30, a, a);
const ivec2 s = v.zy;
const int e = v.w + s.x;
void main() {
    gl_Position = vec4(s, e, 1);
}
