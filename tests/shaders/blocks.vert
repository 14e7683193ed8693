// Uniform, storage and push-constant blocks, arrays of blocks, std140, std430 and scalar layouts.
#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_nonuniform_qualifier : require
struct Part { mat3 rotation; vec3 origin; };
layout(set = 0, binding = 0) uniform Camera { mat4 view; layout(row_major) mat4 projection; } camera;
layout(set = 0, binding = 1) uniform Parts { Part part; float list[4]; } parts[3];
layout(set = 2, binding = 0, std430) readonly buffer Matrices { mat4 matrices[]; };
layout(set = 2, binding = 1, scalar) buffer Log { uint count; vec3 items[]; } logs[3];
layout(set = 2, binding = 2) readonly buffer Many { vec4 v; } many[];
layout(push_constant) uniform Push { mat4 model; uint part; } push;
layout(location = 0) in vec3 position;
layout(location = 0) out vec4 color;
void main() {
    Part part = parts[push.part].part;
    uint n = atomicAdd(logs[push.part].count, 1u);
    logs[gl_InstanceIndex & 1].items[n] = position;
    color = many[nonuniformEXT(gl_InstanceIndex)].v + logs[1].items.length();
    vec3 local = part.rotation * position + part.origin + parts[1].list[gl_VertexIndex & 3];
    gl_Position = camera.projection * camera.view * matrices[gl_InstanceIndex] * push.model
        * vec4(local, 1.0);
}
