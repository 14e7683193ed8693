// refused: a loop that ends only by `discard`
#version 460
layout(location = 0) in float x;
layout(location = 0) out vec4 color;
float y = 0.0;
void advance() { y += x; if (y > 10.0) discard; }
void main() { color = vec4(1.0); for (;;) advance(); }
