// Images and samplers on their own, in arrays, through functions.
#version 460
#extension GL_EXT_nonuniform_qualifier : require
#extension GL_EXT_samplerless_texture_functions : require
layout(set = 0, binding = 0) uniform texture2D images[6];
layout(set = 0, binding = 1) uniform sampler samplers[4];
layout(set = 1, binding = 0) uniform texture3D volume;
layout(set = 1, binding = 1) uniform samplerShadow comparing;
layout(set = 1, binding = 2) uniform texture2D depth;
layout(set = 1, binding = 3) uniform sampler2D combined[];
layout(set = 1, binding = 4) uniform utexture2D ids;
layout(location = 0) in vec2 uv;
layout(location = 1) flat in int which;
layout(location = 0) out vec4 color;
vec4 through(texture2D t, sampler s) { return texture(sampler2D(t, s), uv); }
vec4 both(sampler2D s) { return texture(s, uv); }
void main() {
    color = texture(sampler2D(images[which], samplers[which & 3]), uv);
    color += through(images[which & 1], samplers[1]);
    color += both(combined[nonuniformEXT(which)]) + both(combined[2]);
    color += texture(sampler3D(volume, samplers[0]), vec3(uv, 0.5));
    color += texture(sampler2DShadow(depth, comparing), vec3(uv, 0.5));
    color += texelFetch(ids, ivec2(uv), 0) + textureSize(images[0], 0).x;
}
