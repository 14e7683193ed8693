#version 460
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;
void main() {
    color = vec4(subgroupAdd(uv.x), subgroupElect() ? 1.0 : 0.0, gl_SubgroupSize, 1.0);
    color.y += float(subgroupBallotBitCount(subgroupBallot(uv.x > 0.5)));
    color.z += float(gl_SubgroupInvocationID) + float(gl_SubgroupLtMask.x);
}
