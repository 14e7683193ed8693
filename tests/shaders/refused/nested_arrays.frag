// refused: UniformConstant OpVariable
// Arrays of arrays of resources: GLSL compiles to this, but Vulkan wants one level only.
#version 460
layout(set = 0, binding = 0) uniform texture2D images[3][2];
layout(set = 0, binding = 1) uniform sampler nearest;
layout(set = 0, binding = 2) buffer Log { uint count; vec3 items[]; } logs[2][3][4];
layout(location = 0) in vec2 uv;
layout(location = 1) flat in int which;
layout(location = 0) out vec4 color;
void main() {
    color = texture(sampler2D(images[which][1], nearest), uv);
    color += vec4(atomicAdd(logs[1][which][3].count, 1u), logs[0][1][2].items[which]);
}
