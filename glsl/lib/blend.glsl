// The blend equations (Vulkan 1.3, chapter 29.1); factors and operations as numbered in state.rs.
#ifndef BLEND_GLSL
#define BLEND_GLSL

vec4 blend_factor(const uint factor, const vec4 source, const vec4 target) {
    switch (factor) {
        case 0u: return vec4(0.0);
        case 1u: return vec4(1.0);
        case 2u: return source;
        case 3u: return 1.0 - source;
        case 4u: return target;
        case 5u: return 1.0 - target;
        case 6u: return vec4(source.a);
        case 7u: return vec4(1.0 - source.a);
        case 8u: return vec4(target.a);
        default: return vec4(1.0 - target.a);
    }
}

// `equation`: source factor, target factor and operation, 4 bits each.
vec4 blend_apply(const uint equation, const vec4 source, const vec4 target) {
    vec4 s = source * blend_factor(equation & 15u, source, target);
    vec4 t = target * blend_factor((equation >> 4) & 15u, source, target);
    switch (equation >> 8) {
        case 0u: return s + t;
        case 1u: return s - t;
        case 2u: return t - s;
        case 3u: return min(source, target);
        default: return max(source, target);
    }
}

// Whether an equation adds, one or source alpha times the source, and one or 1 - source alpha times the
// target. Most do, and CPUs take these without walking through a dozen cases.
bool blend_adds(const uint equation) {
    uint source_factor = equation & 15u, rest = equation >> 4;
    return (source_factor == 1u || source_factor == 6u) && (rest == 1u || rest == 7u);
}

vec4 blend(const uint color, const uint alpha, const vec4 source, const vec4 target) {
    if (blend_adds(color) && blend_adds(alpha)) {
        float rest = 1.0 - source.a;
        vec3 s = source.rgb * ((color & 15u) == 6u ? source.a : 1.0), t = target.rgb * (color >> 4 == 7u ? rest : 1.0);
        float sa = source.a * ((alpha & 15u) == 6u ? source.a : 1.0), ta = target.a * (alpha >> 4 == 7u ? rest : 1.0);
        return vec4(s + t, sa + ta);
    }
    return vec4(blend_apply(color, source, target).rgb, blend_apply(alpha, source, target).a);
}
#endif
