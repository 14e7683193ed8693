// Inputs of every kind and interpolation.
#version 460
struct Light { vec3 direction; float power; };
layout(location = 0) in Block { vec3 normal; layout(location = 5) flat ivec2 id; vec2 uv; } block;
layout(location = 1) in mat2 m;
layout(location = 3) in Light light;
layout(location = 7) noperspective in vec2 screen;
layout(location = 8, component = 0) in float low;
layout(location = 8, component = 1) in vec3 high;
layout(location = 9) centroid in vec2 list[2];
layout(location = 11) flat in vec3 constant;
layout(location = 12) sample in vec2 each;
layout(location = 0) out vec4 color;
layout(location = 1) out ivec4 ids;
layout(location = 2) out uvec2 counts;
layout(location = 3) out float many[2];
void main() {
    color = vec4(block.normal + light.direction * light.power, m[1][0] + low);
    color.xy += block.uv + screen + list[0] + list[1] + constant.xy + each;
    ids = ivec4(block.id, ivec2(high.xy));
    counts = uvec2(high.yz);
    many[0] = color.x;
    many[1] = constant.z;
}
