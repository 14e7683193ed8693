// Sampling of every kind of image with an implicit level of detail.
#version 460
layout(set = 0, binding = 0) uniform sampler1D d1;
layout(set = 0, binding = 1) uniform sampler2D d2;
layout(set = 0, binding = 2) uniform sampler3D d3;
layout(set = 0, binding = 3) uniform samplerCube cube;
layout(set = 0, binding = 4) uniform sampler1DArray d1s;
layout(set = 0, binding = 5) uniform sampler2DArray d2s;
layout(set = 0, binding = 6) uniform samplerCubeArray cubes;
layout(set = 0, binding = 7) uniform sampler2DShadow s2;
layout(set = 0, binding = 8) uniform sampler2DArrayShadow s2s;
layout(set = 0, binding = 9) uniform samplerCubeShadow scube;
layout(set = 0, binding = 10) uniform isampler2D signed2;
layout(set = 0, binding = 11) uniform usampler3D unsigned3;
layout(location = 0) in vec4 p;
layout(location = 0) out vec4 color;
void main() {
    color = texture(d1, p.x) + texture(d2, p.xy) + texture(d3, p.xyz) + texture(cube, p.xyz);
    color += texture(d1s, p.xy) + texture(d2s, p.xyz, 0.3) + texture(cubes, p);
    color += textureProj(d1, p.xy) + textureProj(d2, p.xyz, 0.5) + textureProj(d2, p);
    color += textureProj(d3, p) + textureOffset(d2, p.xy, ivec2(1)) + texture(d1, p.y, 1.0);
    color += texture(s2, p.xyz) + texture(s2s, p) + texture(scube, p) + textureProj(s2, p);
    color += textureOffset(s2, p.xyz, ivec2(1), 0.5) + textureProjOffset(d2, p, ivec2(2));
    color += texture(signed2, p.xy) + texture(unsigned3, p.xyz);
}
