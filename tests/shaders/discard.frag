// Ways to end, with derivatives after them.
#version 460
#extension GL_EXT_demote_to_helper_invocation : require
#extension GL_EXT_terminate_invocation : require
layout(set = 0, binding = 0) uniform sampler2D image;
layout(push_constant) uniform Push { float cut; int steps; } push;
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;
float counter = 0.25;
float tw_user_main(float x) { counter += x; return counter; }
float inside(float a) { if (a < push.cut) discard; return a; }
vec4 only() { discard; return vec4(0.0); }
void main() {
    color = texture(image, uv);
    if (color.a < push.cut) discard;
    for (int i = 0; i < push.steps; i++) {
        if (uv.x * i > 3.0) discard;
        color += texture(image, uv * i);
    }
    switch (push.steps) {
        case 1: discard;
        case 2: color.x = 1.0; break;
        default: if (uv.y > 0.5) { terminateInvocation; } else { color.y = 2.0; }
    }
    for (;;) { if (inside(uv.x) > 0.0) break; }
    if (uv.x > 0.9) demote;
    if (helperInvocationEXT()) color = vec4(0.0);
    if (uv.y > 0.95) color = only();
    color += texture(image, uv * 2.0) + tw_user_main(uv.y) + dFdx(uv.x);
}
