//! Everything the host and the kernels share: constants, and structs of `u32`, `i32` and `f32`.
//!
//! This file, with the enums of `state.rs` and `format.rs`, is the only home of these facts. `cargo spirv`
//! (`glsl/tool`) includes it, hands every constant to the kernels as a macro, compiles `glsl/abi.comp`, reads
//! the members' offsets from its SPIR-V and writes one assertion per constant and field to
//! `glsl/spirv/layout.rs`. So a constant that the kernels were not compiled with, or a struct that differs
//! from its mirror in `glsl/abi.glsl`, is a compile error that names it. Blocks use scalar layout, which for
//! 4-byte scalars is `#[repr(C)]`.

use bytemuck::{Pod, Zeroable};

// `glsl/tool` finds the file beside this one too.
#[path = "abi/push.rs"]
mod push;
#[allow(unused_imports)] // for the tool, which takes their names from GLSL
pub use push::{Batch, Clear, Commands, Narrow, Resolve};

shared_constants! {
    /// Fractional bits of a window coordinate: 1/256 pixel.
    pub const SUBPIXEL_BITS: u32 = 8;
    /// Log2 of a bin's edge in pixels.
    pub const BIN_SIZE_LOG2: u32 = 4;
    /// Pixels of a bin.
    pub const BIN_PIXELS: u32 = 1 << (2 * BIN_SIZE_LOG2);
    /// Levels of cells that triangles are binned into: bins, then coarser and coarser, then everything.
    pub const CELL_LEVELS: u32 = 4;
    /// Log2 of a cell's edge at level 0, the bins.
    pub const CELL_LOG2_0: u32 = BIN_SIZE_LOG2;
    /// Log2 of a cell's edge at level 1.
    pub const CELL_LOG2_1: u32 = 6;
    /// Log2 of a cell's edge at level 2.
    pub const CELL_LOG2_2: u32 = 8;
    /// Log2 of a cell's edge at level 3: one cell holds any target.
    pub const CELL_LOG2_3: u32 = MAX_EXTENT_LOG2;
    /// A triangle is listed in at most this many cells; one that touches more goes one level up.
    pub const MAX_CELLS: u32 = 16;
    /// The most cells under a bounding box for which counting them exactly is worth its loop.
    pub const MAX_CELLS_TESTED: u32 = 64;
    /// Log2 of the largest target edge in pixels.
    pub const MAX_EXTENT_LOG2: u32 = 14;
    /// Window coordinates reach from -2^15 to 2^15 pixels, which holds every viewport that meets a target.
    pub const GUARD_LOG2: u32 = 15;
    /// Triangles that clipping one primitive by six planes can leave.
    pub const MAX_CLIPPED: u32 = 7;
    /// Triangles that clipping one primitive by six planes and by [`MAX_DISTANCES`] of the user's can leave.
    pub const MAX_CLIPPED_BY_DISTANCES: u32 = MAX_CLIPPED + MAX_DISTANCES;
    /// Log2 of the step between the keys of consecutive primitives: room for [`MAX_CLIPPED_BY_DISTANCES`].
    pub const KEY_LOG2: u32 = 4;
    /// Most clip distances and cull distances of a vertex, together.
    pub const MAX_DISTANCES: u32 = 8;
    /// The location of an output or input that stands for the first distances of a vertex. They lie after all other varyings.
    pub const DISTANCE_LOCATION: u32 = 512;
    /// Locations of distances.
    pub const DISTANCE_LOCATIONS: u32 = MAX_DISTANCES / 4;
    /// [`Piece::distances`]: first bit of the number of cull distances. That of clip distances comes before.
    pub const CULL_DISTANCES_SHIFT: u32 = 4;
    /// Fragment pipelines of one batch: one bit each in a bin's mask.
    pub const MAX_FRAGMENT_KERNELS: u32 = 32;
    /// The bits of a pixel's number in its bin that are its column; the other bits are its row. A bin has four 8x8
    /// quadrants, each of 4x4 quads of 2x2 pixels. So 4 or more consecutive pixels that are a power of two in
    /// number, and begin at a multiple of it, are a rectangle.
    pub const PIXEL_COLUMN_BITS: u32 = 0b0100_1101;
    /// Lanes of a quad. They are always of one piece.
    pub const QUAD: u32 = 4;
    /// Bytes of a vertex or index buffer, as a power of two, that one slot of the resource table shows;
    /// longer buffers take several that follow each other. A binding reaches 2^27 bytes on every device.
    pub const WINDOW_LOG2: u32 = 26;
    /// Bytes that such a slot shows beyond its own, so that it shows all of an attribute that begins in it.
    pub const WINDOW_OVERLAP: u32 = 16;
    /// Invocations of a workgroup where nothing else decides.
    pub const GROUP: u32 = 64;
    /// Vertex slots of one invocation of the vertex stage, a workgroup apart.
    pub const VERTEX_ROUNDS: u32 = 8;
    /// Primitives of one invocation of the primitive stage and of scatter, a workgroup apart.
    pub const PRIMITIVE_ROUNDS: u32 = 8;
    /// Input locations of a vertex shader.
    pub const MAX_ATTRIBUTES: u32 = 32;
    /// Input locations of a fragment shader.
    pub const MAX_VARYINGS: u32 = 32;
    /// Elements that one invocation clears or narrows: a workgroup costs more than a few stores.
    pub const CLEAR_ROUNDS: u32 = 16;
    /// What the `constant_id`s of kernels have on top of the numbers that follow, so that they differ from those of users'
    /// shaders. It is added after compiling: some compilers take no `constant_id` above 2047.
    pub const SPEC_FIRST: u32 = 65536;
    /// Specialization constant: the subgroup width, also the workgroup size of subgroup-wide kernels.
    pub const SPEC_WIDTH: u32 = 0;
    /// Specialization constant: invocations of a workgroup of several subgroups, which must be full.
    pub const SPEC_LANES: u32 = 5;
    /// Specialization constant: the depth comparison.
    pub const SPEC_COMPARE: u32 = 1;
    /// Specialization constant: how many samples raster holds in shared memory, those of a bin; 1 if it keeps them in the
    /// targets' own memory.
    pub const SPEC_HELD: u32 = 6;
    /// Specialization constant: samples of a pixel.
    pub const SPEC_SAMPLES: u32 = 10;
    /// First of four specialization constants: where the samples are, a byte each, column and row in 1/16 pixel.
    pub const SPEC_POSITIONS_0: u32 = 11;
    /// The second of them.
    pub const SPEC_POSITIONS_1: u32 = 12;
    /// The third.
    pub const SPEC_POSITIONS_2: u32 = 13;
    /// The last.
    pub const SPEC_POSITIONS_3: u32 = 14;
    /// Specialization constant: whether a fragment shader runs for each sample.
    pub const SPEC_PER_SAMPLE: u32 = 15;
    /// Specialization constant: the `PrimitiveKind` whose fragments are shaded.
    pub const SPEC_PRIMITIVES: u32 = 19;
    /// Specialization constant: whether there may be a stencil test.
    pub const SPEC_STENCIL: u32 = 18;
    /// Specialization constant: whether alpha may say which samples are covered, or be 1 whatever shaders return.
    pub const SPEC_BY_ALPHA: u32 = 17;
    /// Specialization constant: the `ResolveMode`.
    pub const SPEC_RESOLVE_MODE: u32 = 16;
    /// Specialization constant: whether the depths of the batch's triangles may be adjusted: by a bias, or by limits of their own.
    pub const SPEC_ADJUSTED: u32 = 8;
    /// Specialization constant: the bits of a depth in the depth target, 0 if it holds floats.
    pub const SPEC_DEPTH_BITS: u32 = 9;
    /// Specialization constant: the formats of the first four colour targets, a byte each, [`NO_FORMAT`] where there is no
    /// target.
    pub const SPEC_FORMATS: u32 = 2;
    /// Specialization constant: the formats of the other four.
    pub const SPEC_MORE_FORMATS: u32 = 3;
    /// Specialization constant: when the depth test happens, one of `DEPTH_*`.
    pub const SPEC_DEPTH: u32 = 4;
    /// Specialization constant: a bit for each varying location that the fragment shader reads. Outputs of the
    /// vertex shader at other locations are not stored.
    pub const SPEC_READ: u32 = 7;
    /// First of [`MAX_ATTRIBUTES`] specialization constants: the format of each vertex attribute, 0 where
    /// there is none: its `Numeric`, its `Packing` and the number of components from the bits `ATTRIBUTE_*_SHIFT` on,
    /// [`ATTRIBUTE_PER_INSTANCE`] and [`ATTRIBUTE_DIVIDED`].
    pub const SPEC_ATTRIBUTE: u32 = 128;
    /// Attribute format: first of four bits of the packing; the numeric kind comes before.
    pub const ATTRIBUTE_PACKING_SHIFT: u32 = 4;
    /// Attribute format: first bit of the number of components.
    pub const ATTRIBUTE_COUNT_SHIFT: u32 = 8;
    /// Attribute format: it is the same for all vertices of an instance.
    pub const ATTRIBUTE_PER_INSTANCE: u32 = 4096;
    /// Attribute format: it is the same for several instances too, as [`Attribute::stride`] says.
    pub const ATTRIBUTE_DIVIDED: u32 = 8192;
    /// [`Attribute::stride`]: first bit of the divisor.
    pub const ATTRIBUTE_DIVISOR_SHIFT: u32 = 12;
    /// The greatest divisor.
    pub const MAX_DIVISOR: u32 = (1 << (32 - ATTRIBUTE_DIVISOR_SHIFT)) - 1;
    /// Depth test before the shader, write after it unless it discards.
    pub const DEPTH_EARLY_TEST: u32 = 0;
    /// Depth test and write after the shader.
    pub const DEPTH_LATE: u32 = 1;
    /// As [`DEPTH_LATE`], of the depth that the shader writes.
    pub const DEPTH_WRITTEN: u32 = 3;
    /// Depth test and write before the shader, as `layout(early_fragment_tests)` demands. It is also used if the
    /// shader always keeps its fragment: then an early write gives the same picture as a late one.
    pub const DEPTH_EARLY: u32 = 2;

    /// Word that stands for "none": no index buffer, no attribute.
    pub const NONE: u32 = 0xffff_ffff;
    /// Stands in for the cell that lists a primitive, if several cells list it or it was clipped.
    pub const SEVERAL_CELLS: u32 = NONE - 1;

    /// Descriptor set of the engine's own buffers.
    pub const SET_ENGINE: u32 = 0;
    /// Descriptor set of the resource table.
    pub const SET_TABLE: u32 = 1;
    /// Binding of the table's storage buffers.
    pub const TABLE_BUFFERS: u32 = 4;

    /// Vertex slots of a piece: one per vertex of an index range, for each instance.
    pub const VERTEX_RANGED: u32 = 0;
    /// Vertex slots of a piece: one per corner of a primitive.
    pub const VERTEX_PER_CORNER: u32 = 1;
    /// Vertex slots of a piece: a quad per primitive, one for each corner and one that repeats the last corner. So
    /// the slots of any primitive are known without those before it.
    pub const VERTEX_PER_QUAD: u32 = 2;

    /// [`Triangle::flags`]: it has area, faces the right way and may cover a pixel.
    pub const TRIANGLE_VALID: u32 = 1;
    /// [`Triangle::flags`]: it faces the viewer.
    pub const TRIANGLE_FRONT: u32 = 2;
    /// [`Triangle::flags`]: its bounds are cut by the viewport or scissor, so pixels must be tested against them.
    pub const TRIANGLE_CUT: u32 = 4;
    /// [`Triangle::flags`]: its depths are adjusted ([`DEPTH_STATE_ADJUSTED`]).
    pub const TRIANGLE_ADJUSTED: u32 = 8;
    /// [`Triangle::flags`]: first bit of its cell level.
    pub const TRIANGLE_LEVEL_SHIFT: u32 = 4;
    /// [`Triangle::flags`]: first bit of the number of triangles its primitive was clipped into, less one.
    pub const TRIANGLE_EXTRA_SHIFT: u32 = 8;
    /// [`Triangle::flags`]: bits of that number.
    pub const TRIANGLE_EXTRA_BITS: u32 = 4;
    /// [`Triangle::flags`]: it is half of a line whose inputs change along x alone.
    pub const TRIANGLE_ALONG_X: u32 = 4096;
    /// [`Triangle::flags`]: it is half of a line whose inputs change along y alone.
    pub const TRIANGLE_ALONG_Y: u32 = 8192;
    /// [`Triangle::flags`]: first of two bits, the number of the vertex that gives the flat inputs.
    pub const TRIANGLE_PROVOKING_SHIFT: u32 = 14;
    /// [`Triangle::flags`]: first of eight bits, the exponent of the largest depth of its corners if they are adjusted.
    pub const TRIANGLE_EXPONENT_SHIFT: u32 = 16;

    /// The location of an output that is the second source of blending.
    pub const SECOND_SOURCE: u32 = 256;
    /// Most colour targets.
    pub const MAX_COLORS: u32 = 8;
    /// In the place of the format of a colour target that is not there.
    pub const NO_FORMAT: u32 = 255;
    /// Every colour target of a band has room for a multiple of so many pixels, so that the next one begins where texels of
    /// any format may.
    pub const PLANE_PIXELS: u32 = 4;

    /// [`Piece::fragment_state`]: the depth test is on.
    pub const DEPTH_STATE_TEST: u32 = 1;
    /// [`Piece::fragment_state`]: a fragment that passes writes its depth.
    pub const DEPTH_STATE_WRITE: u32 = 2;
    /// [`Piece::fragment_state`]: depths are adjusted by [`Piece::depth_bias`] and kept in [`Piece::depth_limits`].
    pub const DEPTH_STATE_ADJUSTED: u32 = 4;
    /// [`Piece::fragment_state`]: the depth that is there must be within [`Piece::depth_bounds`].
    pub const DEPTH_STATE_BOUNDS: u32 = 64;
    /// [`Piece::fragment_state`]: primitives are not clipped at the near and the far plane.
    pub const DEPTH_STATE_UNCLIPPED: u32 = 128;
    /// [`Piece::fragment_state`]: first bit of the `Compare`.
    pub const DEPTH_STATE_COMPARE_SHIFT: u32 = 3;
    /// [`Piece::fragment_state`]: the alpha of the first colour says how many samples are covered.
    pub const SAMPLE_STATE_ALPHA_COVERS: u32 = 256;
    /// [`Piece::fragment_state`]: alpha is 1 in what follows.
    pub const SAMPLE_STATE_ALPHA_ONE: u32 = 512;
    /// [`Piece::fragment_state`]: fragments change depth and stencil values alone, and their shader has no other effect.
    pub const FRAGMENT_STATE_COLORLESS: u32 = 1024;
    /// [`Piece::fragment_state`]: the last vertex of a primitive gives the flat inputs.
    pub const FRAGMENT_STATE_PROVOKED_LAST: u32 = 2048;
    /// [`Piece::fragment_state`]: first of 16 bits, those of the samples that may be drawn to.
    pub const SAMPLE_STATE_MASK_SHIFT: u32 = 16;

    /// [`Piece::stencil`]: first bit of the `StencilOp` where the stencil test fails. The `Compare` comes before.
    pub const STENCIL_FAIL_SHIFT: u32 = 3;
    /// [`Piece::stencil`]: first bit of the operation where the depth test fails.
    pub const STENCIL_DEPTH_FAIL_SHIFT: u32 = 6;
    /// [`Piece::stencil`]: first bit of the operation where both pass.
    pub const STENCIL_PASS_SHIFT: u32 = 9;
    /// [`Piece::stencil`]: in the second word of a face, first bit of the bits that are compared. The reference comes before.
    pub const STENCIL_COMPARE_MASK_SHIFT: u32 = 8;
    /// [`Piece::stencil`]: in that word, first bit of the bits that operations change.
    pub const STENCIL_WRITE_MASK_SHIFT: u32 = 16;

    /// A blend equation: bits of a factor. The source's factor comes first.
    pub const BLEND_FACTOR_BITS: u32 = 5;
    /// A blend equation: first bit of the target's factor.
    pub const BLEND_TARGET_SHIFT: u32 = BLEND_FACTOR_BITS;
    /// A blend equation: first bit of the operation.
    pub const BLEND_OP_SHIFT: u32 = 2 * BLEND_FACTOR_BITS;
    /// Bits of a blend equation.
    pub const BLEND_BITS: u32 = BLEND_OP_SHIFT + 3;
    /// [`Piece::color_states`]: first bit of alpha's equation; colour's comes before.
    pub const COLOR_ALPHA_SHIFT: u32 = BLEND_BITS;
    /// [`Piece::color_states`]: the equations are applied.
    pub const COLOR_BLENDS: u32 = 1 << (2 * BLEND_BITS);
    /// [`Piece::color_states`]: the equations need [`Piece::blend_constants`].
    pub const COLOR_CONSTANTS: u32 = 1 << (2 * BLEND_BITS + 1);
    /// [`Piece::color_states`]: nothing is blended, and the `LogicOp` in the lowest bits is applied.
    pub const COLOR_LOGIC: u32 = 1 << (BLEND_BITS - 1);
    /// [`Piece::color_states`]: first of four bits that say which channels are written, red first.
    pub const COLOR_MASK_SHIFT: u32 = 2 * BLEND_BITS + 2;
}

const _: () =
    assert!(SECOND_SOURCE >= 256 && DISTANCE_LOCATION > SECOND_SOURCE, "no location of a user's");
const _: () = assert!(WINDOW_OVERLAP == 4 * 4, "four components of four bytes at most");

/// A run of consecutive primitives of one draw inside one batch.
///
/// Kernels fetch it four words at a time. The fields that shading needs come first, then those that the
/// vertex stage needs.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Piece {
    /// Number in the draw of its first primitive; the count goes on from instance to instance.
    pub first_in_draw: u32,
    /// Primitives of one instance of the draw.
    pub primitives_per_instance: u32,
    /// Number in the batch of its first primitive.
    pub first_primitive: u32,
    /// First table slot of the fragment shader's resources.
    pub fragment_resources: u32,
    /// First word of the first slot's varyings.
    pub varying_base: u32,
    /// Words of varyings per slot.
    pub varying_stride: u32,
    /// First vertex slot of the piece.
    pub vertex_base: u32,
    /// Its vertex slots; unused ones follow, so that the next piece's begin at a multiple of [`QUAD`].
    pub vertex_slots: u32,
    /// Clip space to window: factors of x and y.
    pub scale: [f32; 2],
    /// Clip space to window: offsets of x and y.
    pub offset: [f32; 2],
    /// Clip space to window: factor of z.
    pub depth_scale: f32,
    /// Clip space to window: offset of z.
    pub depth_offset: f32,
    /// Index of its fragment kernel in the batch.
    pub fragment_kernel: u32,
    /// A `Cull`.
    pub cull: u32,
    /// A `Topology`.
    pub topology: u32,
    /// Element of the index buffer (or vertex) that is element 0 of the draw.
    pub first_element: u32,
    /// Resource-table slot of the index buffer, or [`NONE`].
    pub index_slot: u32,
    /// Bytes of an index, 2 or 4.
    pub index_bytes: u32,
    /// Added to an index to make `gl_VertexIndex`.
    pub base_vertex: i32,
    /// `gl_InstanceIndex` of the draw's first instance.
    pub first_instance: u32,
    /// [`VERTEX_RANGED`], [`VERTEX_PER_CORNER`] or [`VERTEX_PER_QUAD`].
    pub vertex_mode: u32,
    /// Ranged: the smallest index, which has slot 0.
    pub vertex_min: u32,
    /// Ranged: slots of one instance.
    pub vertices_per_instance: u32,
    /// Ranged: the instance that comes first in the slots.
    pub instance_min: u32,
    /// First of the piece's attributes.
    pub attribute_base: u32,
    /// First table slot of the vertex shader's resources.
    pub vertex_resources: u32,
    /// `gl_DrawID`: the number of the command of an indirect draw, 0 for others.
    pub draw_id: u32,
    /// A `FrontFace`.
    pub front_face: u32,
    /// Whether `rect_min..=rect_max` is smaller than the target.
    pub cut: u32,
    /// How fragments are tested, at `DEPTH_STATE_*` and `SAMPLE_STATE_*`.
    pub fragment_state: u32,
    /// First pixel of viewport and scissor, x then y.
    pub rect_min: [i32; 2],
    /// Last pixel of viewport and scissor, x then y.
    pub rect_max: [i32; 2],
    /// For each colour target its blend equations and which channels are written, at `COLOR_*`.
    pub color_states: [u32; MAX_COLORS as usize],
    /// Depth bias: the constant factor, the slope factor, the clamp.
    pub depth_bias: [f32; 3],
    /// Least and greatest depth of the depth bounds test.
    pub depth_bounds: [f32; 2],
    /// Least and greatest depth of a fragment.
    pub depth_limits: [f32; 2],
    /// Constant colour and constant alpha of blending.
    pub blend_constants: [f32; 4],
    /// The stencil test of front faces, then of back faces, two words each, at `STENCIL_*`: comparison and operations, reference
    /// and masks. Without a test, all fragments pass and nothing changes.
    pub stencil: [[u32; 2]; 2],
    /// Of lines, in pixels.
    pub line_width: f32,
    /// A `LineMode`.
    pub line_mode: u32,
    /// How many clip distances and cull distances the vertices have.
    pub distances: u32,
}

/// The memory that one input location of a vertex shader reads.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Attribute {
    /// Resource-table slot of the buffer, or [`NONE`].
    pub slot: u32,
    /// Byte of element 0.
    pub offset: u32,
    /// Bytes from element to element, below the bit [`ATTRIBUTE_DIVISOR_SHIFT`]; from there on the instances that read the same
    /// element, 0 for all instances of a draw, if the attribute is [`ATTRIBUTE_DIVIDED`].
    pub stride: u32,
    /// The last element that the buffer's range holds. Elements beyond it are read as this one.
    pub last: u32,
}

/// A triangle after setup, for raster, z-test and shading. Shading reads only the second half, two words for
/// each lane of a quad.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Triangle {
    /// Corners in 1/256 pixel from the centre of pixel (0, 0), clockwise on the screen.
    pub x: [i32; 3],
    /// First pixel that may be covered: x in the low half, y in the high half.
    pub bounds_min: u32,
    /// See `x`.
    pub y: [i32; 3],
    /// Last pixel that may be covered.
    pub bounds_max: u32,
    /// Depth at the centre of the target's pixel (0, 0), or at its upper left corner if pixels have several samples.
    pub z: f32,
    /// Change of depth per pixel to the right.
    pub dzdx: f32,
    /// Change of depth per pixel down.
    pub dzdy: f32,
    /// Its piece.
    pub piece: u32,
    /// Vertex slots of the primitive's three vertices.
    pub vertices: [u32; 3],
    /// `TRIANGLE_*`.
    pub flags: u32,
}
