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

// The component at byte `byte` of the buffer in table slot `slot`. Components are aligned to their size.
uint fetch_component(const uint slot, const uint component, const uint byte) {
    uint word = table[nonuniformEXT(slot)].words[byte >> 2];
    return component_value(component, component_bytes(component) == 4u ? word : word >> ((byte & 3u) * 8u));
}

bool is_per_instance(const uint location) {
    return (attribute_format(location) & ATTRIBUTE_PER_INSTANCE) != 0u;
}

// The components of an attribute; those that its format lacks are 0.
uvec4 fetch(const uint location) {
    uvec4 value = uvec4(0u);
    uint format = attribute_format(location);
    if (format == 0u) return value;
    uint component = format & ((1u << ATTRIBUTE_COUNT_SHIFT) - 1u), count = attribute_count(location);
    // No local variable holds the attribute: a lane that is switched off would leave the variable undefined.
    uint index = min(uint(is_per_instance(location) ? tw_InstanceIndex : tw_VertexIndex), bound_attributes[location].last);
    uint byte = bound_attributes[location].offset + bound_attributes[location].stride * index;
    uint slot = bound_attributes[location].slot + (byte >> WINDOW_LOG2), size = component_bytes(component);
    byte &= (1u << WINDOW_LOG2) - 1u;
    value.x = fetch_component(slot, component, byte);
    if (count > 1u) value.y = fetch_component(slot, component, byte + size);
    if (count > 2u) value.z = fetch_component(slot, component, byte + 2u * size);
    if (count > 3u) value.w = fetch_component(slot, component, byte + 3u * size);
    return value;
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
