// A loop whose only exit is `discard` ends.
#version 460
layout(location = 0) in float x;
layout(location = 0) out vec4 color;
void main() {
    float y = x;
    color = vec4(1.0);
    for (;;) { y += 1.0; if (y > 10.0) discard; }
}
