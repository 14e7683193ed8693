// Buffers by address.
#version 460
#extension GL_EXT_buffer_reference : require
layout(buffer_reference) buffer Node;
layout(buffer_reference, std430) buffer Node { vec4 color; Node next; };
layout(push_constant) uniform Push { Node first; } push;
layout(location = 0) out vec4 color;
void main() {
    color = push.first.next.color;
    push.first.color = vec4(2.0);
}
