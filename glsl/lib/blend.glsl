// The blend equations (Vulkan 1.3, chapter 29.1).
#ifndef BLEND_GLSL
#define BLEND_GLSL

// The parts of equations.
#define PARTS(T) \
    T source_factor(const T equation) { \
        return equation & ((1u << BLEND_FACTOR_BITS) - 1u); \
    } \
    T target_factor(const T equation) { \
        return (equation >> BLEND_TARGET_SHIFT) & ((1u << BLEND_FACTOR_BITS) - 1u); \
    } \
    T blend_op(const T equation) { \
        return equation >> BLEND_OP_SHIFT; \
    }
PARTS(uint)
PARTS(uvec4)

// Each odd factor is 1 minus the even factor before it (`BlendFactor` of state.rs). Each channel has a factor of its own, which
// is chosen by selections, because drivers for CPUs turn a switch into a dozen branches and compile them all. Factors of a
// signed normalized target (`has_sign`) are at most 1, those of a float may be anything, and all others are in 0..=1 by
// themselves.
#define BEFORE(first) lessThan(factor, uvec4(first))
vec4 blend_factor(const uvec4 factor, const vec4 source, const vec4 target, const vec4 constants, const vec4 second, const bool has_sign) {
    vec4 color = mix(target, source, BEFORE(BLEND_FACTOR_DST_COLOR));
    vec4 alpha = mix(vec4(target.a), vec4(source.a), BEFORE(BLEND_FACTOR_DST_ALPHA));
    vec4 fixed_value = mix(vec4(constants.a), constants, BEFORE(BLEND_FACTOR_CONSTANT_ALPHA));
    vec4 saturated = vec4(vec3(min(source.a, 1.0 - target.a)), 1.0);
    vec4 of_second = mix(vec4(second.a), second, BEFORE(BLEND_FACTOR_SRC1_ALPHA));
    vec4 even = mix(of_second, saturated, BEFORE(BLEND_FACTOR_SRC1_COLOR));
    even = mix(even, fixed_value, BEFORE(BLEND_FACTOR_SRC_ALPHA_SATURATE));
    even = mix(even, alpha, BEFORE(BLEND_FACTOR_CONSTANT_COLOR));
    even = mix(even, color, BEFORE(BLEND_FACTOR_SRC_ALPHA));
    even = mix(even, vec4(0.0), BEFORE(BLEND_FACTOR_SRC_COLOR));
    vec4 rest = has_sign ? min(1.0 - even, 1.0) : 1.0 - even;
    return mix(even, rest, notEqual(factor & 1u, uvec4(0u)));
}
#undef BEFORE

// `equation` is that of colour three times, then that of alpha.
vec4 blend_apply(const uvec4 equation, const vec4 source, const vec4 target, const vec4 constants, const vec4 second, const bool has_sign) {
    uvec4 op = blend_op(equation);
    vec4 s = source * blend_factor(source_factor(equation), source, target, constants, second, has_sign);
    vec4 t = target * blend_factor(target_factor(equation), source, target, constants, second, has_sign);
    vec4 sum = mix(mix(t - s, s - t, equal(op, uvec4(BLEND_OP_SUBTRACT))), s + t, equal(op, uvec4(BLEND_OP_ADD)));
    vec4 extreme = mix(max(source, target), min(source, target), equal(op, uvec4(BLEND_OP_MIN)));
    return mix(extreme, sum, lessThan(op, uvec4(BLEND_OP_MIN)));
}

// Whether an equation adds (one or source alpha) * source and (one or 1 - source alpha) * target. Most
// equations do, and CPUs compute them without walking through a dozen cases.
bool blend_adds(const uint equation) {
    uint s = source_factor(equation), t = target_factor(equation);
    return blend_op(equation) == BLEND_OP_ADD && (s == BLEND_FACTOR_ONE || s == BLEND_FACTOR_SRC_ALPHA) &&
           (t == BLEND_FACTOR_ONE || t == BLEND_FACTOR_ONE_MINUS_SRC_ALPHA);
}

// Whether a finite source whose alpha is 0 leaves the target as it is. It does if the equations multiply the
// source by its alpha (the equation of alpha may multiply by one) and the target by one or 1 - source alpha.
bool blend_keeps(const uint color, const uint alpha) {
    return blend_adds(color) && blend_adds(alpha) && source_factor(color) == BLEND_FACTOR_SRC_ALPHA;
}

vec4 blend(const uint color, const uint alpha, const vec4 source, const vec4 target, const vec4 constants, const vec4 second, const bool has_sign) {
    if (blend_adds(color) && blend_adds(alpha)) {
        float rest = has_sign ? min(1.0 - source.a, 1.0) : 1.0 - source.a;
        float by_color = source_factor(color) == BLEND_FACTOR_SRC_ALPHA ? source.a : 1.0;
        float by_alpha = source_factor(alpha) == BLEND_FACTOR_SRC_ALPHA ? source.a : 1.0;
        float rest_color = target_factor(color) == BLEND_FACTOR_ONE_MINUS_SRC_ALPHA ? rest : 1.0;
        float rest_alpha = target_factor(alpha) == BLEND_FACTOR_ONE_MINUS_SRC_ALPHA ? rest : 1.0;
        return vec4(source.rgb * by_color + target.rgb * rest_color, source.a * by_alpha + target.a * rest_alpha);
    }
    return blend_apply(uvec4(color, color, color, alpha), source, target, constants, second, has_sign);
}

// The bits of `source` and of `target` by the truth table of a `LogicOp`.
uvec4 logic(const uint op, const uvec4 source, const uvec4 target) {
    uvec4 in_both = (op & LOGIC_OP_AND) != 0u ? source & target : uvec4(0u);
    uvec4 in_source = (op & LOGIC_OP_AND_REVERSE) != 0u ? source & ~target : uvec4(0u);
    uvec4 in_target = (op & LOGIC_OP_AND_INVERTED) != 0u ? ~source & target : uvec4(0u);
    uvec4 in_none = (op & LOGIC_OP_NOR) != 0u ? ~(source | target) : uvec4(0u);
    return in_both | in_source | in_target | in_none;
}
#endif
