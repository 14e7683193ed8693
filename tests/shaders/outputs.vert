// Outputs of every kind: blocks, structs, arrays, matrices, integers, packed components.
#version 460
struct Light { vec3 direction; float power; };
layout(location = 0) in vec3 position;
layout(location = 0) out Block { vec3 normal; layout(location = 5) flat ivec2 id; vec2 uv; } block;
layout(location = 1) out mat2 m;
layout(location = 3) out Light light;
layout(location = 7) noperspective out vec2 screen;
layout(location = 8, component = 0) out float low;
layout(location = 8, component = 1) out vec3 high;
layout(location = 9) out vec2 list[2];
out gl_PerVertex { vec4 gl_Position; float gl_PointSize; };
void main() {
    gl_Position = vec4(position, 1.0);
    gl_PointSize = 2.0;
    block.normal = gl_Position.zyx;
    block.id = ivec2(gl_VertexIndex, gl_InstanceIndex);
    block.uv = position.xy;
    m = mat2(1.0);
    light = Light(position, 2.0);
    screen = gl_Position.xy / gl_Position.w;
    low = 1.0;
    high = vec3(1.0, 2.0, 3.0);
    for (int i = 0; i < 2; i++) list[i] = position.xy * i;
}
