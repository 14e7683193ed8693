// Derivatives of every size, and of expressions in branches.
#version 460
#extension GL_ARB_derivative_control : enable
layout(location = 0) in vec4 v;
layout(location = 0) out vec4 color;
void main() {
    color = dFdx(v) + dFdyFine(v) + fwidthCoarse(v);
    color.xyz += dFdx(v.xyz) + dFdy(v.xyz) + fwidth(v.xyz);
    color.xy += dFdxCoarse(v.xy) + dFdyCoarse(v.xy) + fwidthFine(v.xy);
    if (v.x > 0.5) color.x += dFdx(v.x) + dFdy(v.x) + fwidth(v.x);
}
