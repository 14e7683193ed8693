#version 450
// Metallic-roughness under one key light and a sky and ground. With ALPHA_MASK it discards
// fragments below the cutoff; without, nothing in it discards, so depth can be tested early.

layout(location = 0) in vec3 in_to_viewer;
layout(location = 1) in vec3 in_normal;
layout(location = 2) in vec4 in_tangent;
layout(location = 3) in vec4 in_uv;
layout(location = 4) in vec4 in_color;

layout(location = 0) out vec4 out_color;

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

layout(set = 1, binding = 0) uniform Material {
    vec4 base_color;
    vec4 emissive; // w: alpha cutoff
    vec4 surface;  // metallic, roughness, normal scale, occlusion strength
    vec4 specular; // specular colour, glossiness
    uvec4 flags;
    vec4 uv_rows[10];
} material;

layout(set = 1, binding = 1) uniform sampler2D base_color_map;
layout(set = 1, binding = 2) uniform sampler2D metallic_roughness_map;
layout(set = 1, binding = 3) uniform sampler2D normal_map;
layout(set = 1, binding = 4) uniform sampler2D occlusion_map;
layout(set = 1, binding = 5) uniform sampler2D emissive_map;

const int BASE_COLOR = 0;
const int METALLIC_ROUGHNESS = 1;
const int NORMAL = 2;
const int OCCLUSION = 3;
const int EMISSIVE = 4;
const int UNLIT = 5;
const int ALPHA = 6;
const int SPECULAR = 7;

bool has(int flag) {
    return (material.flags.x >> flag & 1u) != 0u;
}

// The two rows of a map's texture transform.
#define UV_ROWS(map) material.uv_rows[2 * (map)], material.uv_rows[2 * (map) + 1]

vec2 map_uv(vec4 u, vec4 v) {
    vec3 uv = vec3(u.w > 0.5 ? in_uv.zw : in_uv.xy, 1.0);
    return vec2(dot(u.xyz, uv), dot(v.xyz, uv));
}

vec3 unit(vec3 v) {
    return v * inversesqrt(max(dot(v, v), 1e-30));
}

// The shading normal: bent by the normal map, then reversed on back faces, which see a bump as a
// dent.
vec3 shading_normal(vec3 mapped) {
    vec3 normal = unit(in_normal);
    if (has(NORMAL)) {
        vec3 tangent = unit(in_tangent.xyz - normal * dot(normal, in_tangent.xyz));
        vec3 bitangent = cross(normal, tangent) * in_tangent.w;
        mapped.xy *= material.surface.z;
        normal = unit(tangent * mapped.x + bitangent * mapped.y + normal * mapped.z);
    }
    return gl_FrontFacing ? normal : -normal;
}

// The surroundings in a direction, blurred as a surface of this roughness reflects them.
vec3 surroundings(vec3 direction, float roughness) {
    float soft = mix(0.12, 1.0, roughness);
    float up = clamp(direction.y / soft, -1.0, 1.0);
    vec3 blurred_horizon = mix(frame.horizon.rgb, (frame.sky.rgb + frame.ground.rgb) * 0.5, roughness);
    vec3 far_side = up > 0.0 ? frame.sky.rgb : frame.ground.rgb;
    return mix(blurred_horizon, far_side, abs(up) * (2.0 - abs(up)));
}

// The share of the surroundings that is reflected towards the viewer, as scale and offset of the
// reflectance at normal incidence: Karis's fit to the integral of GGX (2014).
vec2 environment_brdf(float roughness, float n_dot_v) {
    vec4 r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float a = min(r.x * r.x, exp2(-9.28 * n_dot_v)) * r.x + r.y;
    return vec2(-1.04, 1.04) * a + r.zw;
}

// Cook-Torrance with GGX, the height-correlated Smith term and Schlick's Fresnel, over pi.
vec3 highlight(vec3 n, vec3 v, vec3 l, float roughness, vec3 f0) {
    vec3 h = unit(v + l);
    float n_dot_l = max(dot(n, l), 0.0);
    float n_dot_v = max(dot(n, v), 1e-3);
    float n_dot_h = max(dot(n, h), 0.0);
    float a2 = roughness * roughness * roughness * roughness;
    float d = n_dot_h * n_dot_h * (a2 - 1.0) + 1.0;
    float smith = n_dot_l * sqrt(n_dot_v * n_dot_v * (1.0 - a2) + a2)
        + n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - a2) + a2);
    float f = 1.0 - max(dot(v, h), 0.0);
    vec3 fresnel = f0 + (1.0 - f0) * (f * f * f * f * f);
    return fresnel * (a2 / (d * d) * 0.5 / max(smith, 1e-4));
}

// Keeps colours as they are up to a shoulder, then lets the brightest channel approach 1 while the
// hue fades to white: highlights stay bright without turning a material into another colour.
vec3 compress(vec3 color) {
    const float SHOULDER = 0.76;
    float peak = max(color.r, max(color.g, color.b));
    if (peak <= SHOULDER) {
        return color;
    }
    float room = 1.0 - SHOULDER;
    float compressed = 1.0 - room * room / (peak + room - SHOULDER);
    float fade = 1.0 - 1.0 / (0.15 * (peak - compressed) + 1.0);
    return mix(color * (compressed / peak), vec3(compressed), fade);
}

void main() {
    vec4 base = material.base_color * in_color;
    if (has(BASE_COLOR)) {
        base *= texture(base_color_map, map_uv(UV_ROWS(BASE_COLOR)));
    }
    vec4 surface = vec4(1.0);
    if (has(METALLIC_ROUGHNESS)) {
        surface = texture(metallic_roughness_map, map_uv(UV_ROWS(METALLIC_ROUGHNESS)));
    }
    vec3 mapped = vec3(0.0, 0.0, 1.0);
    if (has(NORMAL)) {
        mapped = texture(normal_map, map_uv(UV_ROWS(NORMAL))).xyz * 2.0 - 1.0;
    }
    float occlusion = 1.0;
    if (has(OCCLUSION)) {
        float map = texture(occlusion_map, map_uv(UV_ROWS(OCCLUSION))).r;
        occlusion = 1.0 + material.surface.w * (map - 1.0);
    }
    vec3 emissive = material.emissive.rgb;
    if (has(EMISSIVE)) {
        emissive *= texture(emissive_map, map_uv(UV_ROWS(EMISSIVE))).rgb;
    }
#ifdef ALPHA_MASK
    // Discard comes after all samples: their derivatives need the neighbours that it may end.
    if (base.a < material.emissive.w) {
        discard;
    }
#endif
    float alpha = has(ALPHA) ? base.a : 1.0;
    if (has(UNLIT)) {
        out_color = vec4(base.rgb, alpha);
        return;
    }

    float metallic = clamp(material.surface.x * surface.b, 0.0, 1.0);
    float roughness = material.surface.y * surface.g;
    vec3 diffuse = base.rgb * (1.0 - metallic);
    vec3 f0 = mix(vec3(0.04), base.rgb, metallic);
    if (has(SPECULAR)) {
        // KHR_materials_pbrSpecularGlossiness: light that is reflected at the surface is not scattered below it.
        vec4 specular = clamp(material.specular * surface, 0.0, 1.0);
        f0 = specular.rgb;
        diffuse = base.rgb * (1.0 - max(f0.r, max(f0.g, f0.b)));
        roughness = 1.0 - specular.a;
    }
    roughness = clamp(roughness, 0.04, 1.0);
    vec3 n = shading_normal(mapped);
    vec3 v = unit(in_to_viewer);
    vec3 l = frame.key_direction.xyz;

    float n_dot_l = max(dot(n, l), 0.0);
    vec3 color = frame.key_color.rgb * n_dot_l
        * (diffuse + highlight(n, v, l, roughness, f0));

    vec3 irradiance = mix(frame.ground.rgb, frame.sky.rgb, n.y * 0.5 + 0.5);
    vec2 brdf = environment_brdf(roughness, max(dot(n, v), 0.0));
    vec3 reflected = surroundings(reflect(-v, n), roughness) * (f0 * brdf.x + brdf.y);
    color += (diffuse * irradiance + reflected) * occlusion + emissive;
    out_color = vec4(compress(color), alpha);
}
