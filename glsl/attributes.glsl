// Fetches the vertex attributes of the user's shader. The buffer of an attribute is looked up once for each piece;
// its value is fetched once for each vertex, or once for each instance if it advances per instance. The file that
// includes this one declares `piece`, the resource table and the variables called tw_*.
#ifndef ATTRIBUTES_GLSL
#define ATTRIBUTES_GLSL
#include "lib/attribute.glsl"
#include "lib/quad.glsl"

layout(scalar, binding = 3) readonly buffer Attributes { uint attributes[][4]; }; // `Attribute`

Attribute bound_attributes[MAX_ATTRIBUTES];
// The values of per-instance attributes, and the number in its draw of the instance that they belong to.
uint bound_instance = NONE;
uvec4 instance_values[MAX_ATTRIBUTES];

void tw_bind_attribute(const in uint location) {
    uvec4 words = of_quad(attributes[piece.attribute_base + location][QUAD_LANE]);
    bound_attributes[location] = Attribute(words.x, words.y, words.z, words.w);
}

// What is in the buffer in table slot `slot` from byte `byte` on, where a component of the packing begins.
uint fetch_word(const uint slot, const uint packing, const uint byte) {
    uint word = table[nonuniformEXT(slot)].words[byte >> 2];
    return component_bytes(packing) == 4u ? word : word >> ((byte & 3u) * 8u);
}

bool is_divided(const uint location) {
    return (attribute_format(location) & ATTRIBUTE_DIVIDED) != 0u;
}

// The element that the bound instance reads.
uint element_of_instance(const uint location) {
    if (!is_divided(location)) return uint(tw_InstanceIndex);
    uint divisor = bound_attributes[location].stride >> ATTRIBUTE_DIVISOR_SHIFT;
    uint after_first = uint(tw_InstanceIndex - tw_BaseInstance);
    return uint(tw_BaseInstance) + (divisor == 0u ? 0u : after_first / divisor);
}

uint stride_of(const uint location) {
    uint stride = bound_attributes[location].stride;
    return is_divided(location) ? stride & ((1u << ATTRIBUTE_DIVISOR_SHIFT) - 1u) : stride;
}

bool is_per_instance(const uint location) {
    return (attribute_format(location) & ATTRIBUTE_PER_INSTANCE) != 0u;
}

// The components of an attribute; those that its format lacks are 0.
uvec4 fetch(const uint location) {
    uvec4 value = uvec4(0u);
    uint format = attribute_format(location);
    if (format == 0u) return value;
    uint packing = attribute_packing(location), count = attribute_count(location);
    // No local variable holds the attribute: a lane that is switched off would leave the variable undefined.
    uint element = min(is_per_instance(location) ? element_of_instance(location) : uint(tw_VertexIndex), bound_attributes[location].last);
    uint byte = bound_attributes[location].offset + stride_of(location) * element;
    uint slot = bound_attributes[location].slot + (byte >> WINDOW_LOG2);
    byte &= (1u << WINDOW_LOG2) - 1u;
    value.x = fetch_word(slot, packing, byte + component_byte(packing, 0u));
    if (count > 1u) value.y = fetch_word(slot, packing, byte + component_byte(packing, 1u));
    if (count > 2u) value.z = fetch_word(slot, packing, byte + component_byte(packing, 2u));
    if (count > 3u) value.w = fetch_word(slot, packing, byte + component_byte(packing, 3u));
    return attribute_decode(attribute_numeric(location), packing, value);
}

uvec4 attribute_value(const uint location, const uint one) {
    uvec4 value = is_per_instance(location) ? instance_values[location] : fetch(location);
    if (attribute_count(location) < 4u) value.w = one;
    return value;
}

vec4 tw_attribute_float(const in uint location) {
    return uintBitsToFloat(attribute_value(location, floatBitsToUint(1.0)));
}

uvec4 tw_attribute_uint(const in uint location) {
    return attribute_value(location, 1u);
}

void tw_bind_instance_attribute(const in uint location) {
    if (is_per_instance(location)) instance_values[location] = fetch(location);
}
#endif
