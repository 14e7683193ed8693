// The vertex attributes of the user's shader: where they are read, once for each piece, for each instance or for each
// vertex. What includes this has declared `piece`, the resource table and the variables called tw_*.
#ifndef ATTRIBUTES_GLSL
#define ATTRIBUTES_GLSL
#include "lib/attribute.glsl"
#include "lib/quad.glsl"

layout(scalar, binding = 3) readonly buffer Attributes { uint attributes[][3]; }; // `Attribute`

Attribute bound_attributes[MAX_ATTRIBUTES];
// Which instance of its draw the values of attributes per instance are of, and these.
uint bound_instance = NONE;
uvec4 instance_values[MAX_ATTRIBUTES];

void tw_bind_attribute(const in uint location) {
    uvec4 words = of_quad(attributes[piece.attribute_base + location][min(QUAD_LANE, 2u)]);
    bound_attributes[location] = Attribute(words.x, words.y, words.z);
}

// The component at `byte` of what the slot shows. Components are aligned to their size.
uint fetch_component(const uint slot, const uint component, const uint byte) {
    uint word = table[nonuniformEXT(slot)].words[byte >> 2];
    return component_value(component, component_bytes(component) == 4u ? word : word >> ((byte & 3u) * 8u));
}

bool is_per_instance(const uint location) {
    return (attribute_format(location) & ATTRIBUTE_PER_INSTANCE) != 0u;
}

// Components that the format has not are 0.
uvec4 fetch(const uint location) {
    uvec4 value = uvec4(0u);
    uint format = attribute_format(location);
    if (format == 0u) return value;
    uint component = format & ((1u << ATTRIBUTE_COUNT_SHIFT) - 1u), count = attribute_count(location);
    // Not through a local variable, which a lane that is switched off would leave undefined.
    uint index = uint(is_per_instance(location) ? tw_InstanceIndex : tw_VertexIndex);
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
