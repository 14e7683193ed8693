#version 460
layout(location = 0) in vec3 position;
void main() {
    gl_Position = vec4(position, 1.0)
        + vec4(gl_BaseVertex, gl_BaseInstance, gl_DrawID, gl_InstanceIndex + gl_VertexIndex);
}
