// The structs of src/abi.rs, member for member. The build script compares the two.
#ifndef ABI_GLSL
#define ABI_GLSL
#ifndef BIN_SIZE_LOG2
#error "constants come from src/abi.rs through the build script"
#endif
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require

struct Batch {
    uint width;
    uint height;
    uint origin_y;
    uint bins_x;
    uint bins;
    uint cell_first[4];
    uint cell_columns[4];
    uint cells;
    uint primitives;
    uint extra_first;
    uint piece_first;
    uint piece_count;
    uint run_first;
    uint run_count;
    uint slot_first;
    uint slot_count;
    uint fragment_kernel;
    uint fragment_kernels;
};

struct Clear {
    vec4 color;
    uint pixels;
};

struct Piece {
    uint first_in_draw;
    uint primitives_per_instance;
    uint first_primitive;
    uint fragment_resources;
    uint varying_base;
    uint varying_stride;
    uint vertex_base;
    uint vertex_slots;
    vec3 scale;
    vec3 offset;
    uint fragment_kernel;
    uint cull;
    uint topology;
    uint first_element;
    uint index_slot;
    uint index_bytes;
    int base_vertex;
    uint first_instance;
    uint vertex_mode;
    uint vertex_min;
    uint vertices_per_instance;
    uint instance_min;
    uint attribute_base;
    uint vertex_resources;
    uint draw_id;
    uint front_face;
    uint cut;
    uint depth_test;
    ivec2 rect_min;
    ivec2 rect_max;
    uint depth_write;
    uint depth_compare;
    uint blend;
    uint blend_color;
    uint blend_alpha;
};

struct Attribute {
    uint slot;
    uint offset;
    uint stride;
};

struct Triangle {
    ivec3 x;
    ivec3 y;
    uint bounds_min;
    uint bounds_max;
    float z;
    float dzdx;
    float dzdy;
    uint piece;
    uvec3 vertices;
    uint flags;
};
#endif
