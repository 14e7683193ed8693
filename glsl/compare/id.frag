#version 450
// Writes the id of the primitive into the four bytes of an RGBA8 UNORM target, least significant
// first. ID_SET and ID_BINDING are a place that the vertex shader beside it leaves free.

layout(set = ID_SET, binding = ID_BINDING, std140) uniform Ids {
    uint first_id;
};

layout(location = 0) out vec4 id_bytes;

void main() {
    id_bytes = unpackUnorm4x8(first_id + uint(gl_PrimitiveID));
}
