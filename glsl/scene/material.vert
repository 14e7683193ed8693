#version 450
// Places a vertex in the world and on the screen. See material.frag for what becomes of it.

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
    mat4 view_projection;
    vec4 eye; // w: 1 if the view is a perspective
    vec4 backward;
    vec4 key_direction;
    vec4 key_color;
    vec4 sky;
    vec4 horizon;
    vec4 ground;
} frame;

layout(push_constant) uniform Draw {
    mat4 model;
    vec4 normal_x; // columns of the matrix for normals; w: -1 if the model mirrors
    vec4 normal_y;
    vec4 normal_z;
} draw;

layout(location = 0) out vec3 out_position;
layout(location = 1) out vec3 out_normal;
layout(location = 2) out vec4 out_tangent;
layout(location = 3) out vec4 out_uv;
layout(location = 4) out vec4 out_color;

void main() {
    mat3 instance = transpose(mat3(in_instance_x.xyz, in_instance_y.xyz, in_instance_z.xyz));
    // Cofactors turn normals right under any scale, flat ones included; mirrors change their sign.
    mat3 cofactors = mat3(
        cross(instance[1], instance[2]),
        cross(instance[2], instance[0]),
        cross(instance[0], instance[1]));
    float mirror = dot(instance[0], cofactors[0]) < 0.0 ? -1.0 : 1.0;
    mat3 to_world = mat3(draw.normal_x.xyz, draw.normal_y.xyz, draw.normal_z.xyz);

    // Precise: the classic pipeline and the kernels must place a vertex at the same bits.
    vec4 local = vec4(in_position, 1.0);
    precise vec4 placed = vec4(
        dot(in_instance_x, local), dot(in_instance_y, local), dot(in_instance_z, local), 1.0);
    precise vec4 world = draw.model * placed;
    precise vec4 clip = frame.view_projection * world;
    gl_Position = clip;

    out_position = world.xyz;
    out_normal = to_world * (cofactors * in_normal) * mirror;
    out_tangent = vec4(
        mat3(draw.model) * (instance * in_tangent.xyz),
        in_tangent.w * mirror * draw.normal_x.w);
    out_uv = vec4(in_uv0, in_uv1);
    out_color = in_color;
}
