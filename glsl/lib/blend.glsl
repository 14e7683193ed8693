// The blend equations (Vulkan 1.3, chapter 29.1); factors and operations as numbered in state.rs.
#ifndef BLEND_GLSL
#define BLEND_GLSL

// Odd factors are 1 minus the even ones before them. Selections, because drivers for CPUs make a dozen branches
// of a switch, and compile them all.
vec4 blend_factor(const uint factor, const vec4 source, const vec4 target) {
    vec4 even = factor < 4u ? source : (factor < 6u ? target : vec4(factor < 8u ? source.a : target.a));
    if (factor < 2u) even = vec4(0.0);
    return (factor & 1u) != 0u ? 1.0 - even : even;
}

// `equation`: source factor, target factor and operation, 4 bits each.
vec4 blend_apply(const uint equation, const vec4 source, const vec4 target) {
    uint operation = equation >> 8;
    vec4 s = source * blend_factor(equation & 15u, source, target);
    vec4 t = target * blend_factor((equation >> 4) & 15u, source, target);
    vec4 sum = operation == 0u ? s + t : (operation == 1u ? s - t : t - s);
    vec4 extreme = operation == 3u ? min(source, target) : max(source, target);
    return operation < 3u ? sum : extreme;
}

// Whether an equation adds, one or source alpha times the source, and one or 1 - source alpha times the
// target. Most do, and CPUs take these without walking through a dozen cases.
bool blend_adds(const uint equation) {
    uint source_factor = equation & 15u, rest = equation >> 4;
    return (source_factor == 1u || source_factor == 6u) && (rest == 1u || rest == 7u);
}

// Whether a finite source without alpha leaves the target as it is: source alpha times the source, or for
// alpha itself once, and one or 1 - source alpha times the target.
bool blend_keeps(const uint color, const uint alpha) {
    return blend_adds(color) && blend_adds(alpha) && (color & 15u) == 6u;
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
