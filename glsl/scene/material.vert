#version 450
// Places a vertex in the world and on the screen for material.frag.

layout(location = 0) in vec3 in_position;
layout(location = 1) in vec3 in_normal;
layout(location = 2) in vec4 in_tangent;
layout(location = 3) in vec2 in_uv0;
layout(location = 4) in vec2 in_uv1;
layout(location = 5) in vec4 in_color;
// Rows of the instance's affine matrix to the space of the draw.
layout(location = 6) in vec4 in_instance_x;
layout(location = 7) in vec4 in_instance_y;
layout(location = 8) in vec4 in_instance_z;

layout(set = 0, binding = 0) uniform Frame {
    // Columns of the matrix from x, y and w of clip space to the direction towards the viewer.
    vec4 to_viewer_x;
    vec4 to_viewer_y;
    vec4 to_viewer_w;
    vec4 key_direction;
    vec4 key_color;
    vec4 sky;
    vec4 horizon;
    vec4 ground;
} frame;

layout(push_constant) uniform Draw {
    mat4 clip;
    // Columns of the matrix that turns directions to the world; w of the first: -1 if mirrored.
    vec4 model_x;
    vec4 model_y;
    vec4 model_z;
} draw;

layout(location = 0) out vec3 out_to_viewer;
layout(location = 1) out vec3 out_normal;
layout(location = 2) out vec4 out_tangent;
layout(location = 3) out vec4 out_uv;
layout(location = 4) out vec4 out_color;

void main() {
    mat3 instance = transpose(mat3(in_instance_x.xyz, in_instance_y.xyz, in_instance_z.xyz));
    mat3 turn = mat3(draw.model_x.xyz, draw.model_y.xyz, draw.model_z.xyz) * instance;
    // The cofactor matrix transforms normals correctly under any scale, even one of 0; a mirror changes their sign.
    mat3 cofactors =
        mat3(cross(turn[1], turn[2]), cross(turn[2], turn[0]), cross(turn[0], turn[1]));
    float mirror = draw.model_x.w;

    // Precise: the classic pipeline and the kernels must compute the same bits of a position.
    vec4 local = vec4(in_position, 1.0);
    precise vec4 placed = vec4(
        dot(in_instance_x, local), dot(in_instance_y, local), dot(in_instance_z, local), 1.0);
    precise vec4 clip = draw.clip * placed;
    gl_Position = clip;
    gl_PointSize = 1.0;

    mat3 to_viewer = mat3(frame.to_viewer_x.xyz, frame.to_viewer_y.xyz, frame.to_viewer_w.xyz);
    out_to_viewer = to_viewer * clip.xyw;
    out_normal = cofactors * in_normal * mirror;
    out_tangent = vec4(turn * in_tangent.xyz, in_tangent.w * mirror);
    out_uv = vec4(in_uv0, in_uv1);
    out_color = in_color;
}
