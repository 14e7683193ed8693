// The structs of src/abi.rs, member for member. glsl/spirv/layout.rs compares the two.
#ifndef ABI_GLSL
#define ABI_GLSL
#ifndef BIN_SIZE_LOG2
#error "constants come from src/abi.rs: compile by `cargo spirv`"
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
    uint piece_first;
    uint piece_count;
    uint run_first;
    uint run_count;
    uint slot_first;
    uint slot_count;
    uint fragment_kernel;
    uint fragment_kernels;
    uint traced;
    uint followed;
    int reach;
};

struct Clear {
    uvec4 texels;
    uint count;
    uint first;
};

struct Resolve {
    uint pixels;
    uint first_sample;
    uint first_texel;
    uint to_samples;
};

struct Narrow {
    uint pixels;
    uint first;
    uint texel_bytes;
    uint depth_bits;
    uint to_rows;
};

struct Commands {
    uint piece;
    uint slot;
    uint byte;
    uint stride;
    uint draws;
    uint count_slot;
    uint count_byte;
    uint elements;
    uint first;
    uint primitives;
    uint of_group[2];
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
    vec2 scale;
    vec2 offset;
    float depth_scale;
    float depth_offset;
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
    uint fragment_state;
    ivec2 rect_min;
    ivec2 rect_max;
    uint color_states[MAX_COLORS];
    vec3 depth_bias;
    vec2 depth_bounds;
    vec2 depth_limits;
    vec4 blend_constants;
    uvec2 stencil[2];
    float line_width;
    uint line_mode;
    uint distances;
};

struct Attribute {
    uint slot;
    uint offset;
    uint stride;
    uint last;
};

struct Triangle {
    ivec3 x;
    uint bounds_min;
    ivec3 y;
    uint bounds_max;
    float z;
    float dzdx;
    float dzdy;
    uint piece;
    uvec3 vertices;
    uint flags;
};

// `Piece` as the lanes of a quad fetch it (`lib/quad.glsl`). The fields that a comment names follow each
// other from there on; glsl/tool compares these too.
struct QuadPiece {
    uvec4 numbers;  // first_in_draw, primitives_per_instance, first_primitive, fragment_resources
    uvec4 vertices; // varying_base, varying_stride, vertex_base, vertex_slots
    uvec4 viewport; // scale, offset
    float depth_scale, depth_offset;
    uint fragment_kernel, cull;
    uvec4 elements; // topology, first_element, index_slot, index_bytes
    uvec4 indices;  // base_vertex, first_instance, vertex_mode, vertex_min
    uvec4 stage;    // vertices_per_instance, instance_min, attribute_base, vertex_resources
    uint draw_id, front_face, cut, fragment_state;
    ivec2 rect_min, rect_max;
    uvec4 colors[MAX_COLORS / 4u]; // color_states
    vec3 depth_bias;
    vec2 depth_bounds;
    vec2 depth_limits;
    vec4 blend_constants;
    uvec2 stencil[2];
    float line_width;
    uint line_mode;
    uint distances;
};

// `Triangle` by pairs of words, one pair for each lane of a quad in either half.
struct QuadTriangle {
    uvec2 raster[4];  // x, bounds_min, y, bounds_max
    uvec2 shading[4]; // z, dzdx, dzdy, piece, vertices, flags
};
#endif
