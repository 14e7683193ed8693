#version 450
// Writes the id of the primitive into the four bytes of an RGBA8 UNORM target, least significant
// first. ID_OFFSET is where the push constants of the vertex shader beside it end.

layout(push_constant) uniform Ids {
    layout(offset = ID_OFFSET) uint first_id;
};

layout(location = 0) out vec4 id_bytes;

void main() {
    id_bytes = unpackUnorm4x8(first_id + uint(gl_PrimitiveID));
}
