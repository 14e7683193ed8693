#version 460
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;
layout(depth_greater) out float gl_FragDepth;
void main() {
    color = gl_FragCoord + vec4(gl_FrontFacing, gl_PrimitiveID, gl_HelperInvocation, gl_SampleID);
    color.xy += gl_PointCoord + gl_SamplePosition + vec2(gl_Layer, gl_ViewportIndex);
    gl_SampleMask[0] = gl_SampleMaskIn[0] & 1;
    gl_FragDepth = gl_FragCoord.z + 0.001;
}
