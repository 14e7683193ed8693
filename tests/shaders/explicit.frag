// Sampling and fetches that say their level themselves, gathers and queries.
#version 460
layout(set = 0, binding = 0) uniform sampler2D image;
layout(set = 0, binding = 1) uniform sampler2DShadow shadow;
layout(set = 0, binding = 2) uniform sampler2DMS samples;
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;
void main() {
    color = textureGather(image, uv, 1) + textureGatherOffset(image, uv, ivec2(1));
    color += textureGather(shadow, uv, 0.5) + texelFetch(samples, ivec2(uv), 2);
    color += textureLod(image, uv, 1.0) + textureGrad(image, uv, uv, uv);
    color += texelFetch(image, ivec2(uv), 0) + textureSize(image, 0).x + textureQueryLevels(image);
}
