#version 450
// Writes the id of the primitive into the four bytes of an RGBA8 UNORM target, least significant
// first. Its push constant begins behind the push constants of the vertex shader; src/compare/id_pass.rs
// sets this offset in the compiled module.

layout(push_constant) uniform Ids {
    layout(offset = 0) uint first_id;
};

layout(location = 0) out vec4 id_bytes;

void main() {
    id_bytes = unpackUnorm4x8(first_id + uint(gl_PrimitiveID));
}
