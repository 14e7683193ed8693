//! Macros for constants and enums that the kernels share. Each is written down once, in Rust; `cargo spirv` hands
//! its name and its number to GLSL as a macro.

/// Declares constants, and `CONSTANTS`, the name and the value of each.
macro_rules! shared_constants {
    ($($(#[$meta:meta])* pub const $name:ident: u32 = $value:expr;)*) => {
        $($(#[$meta])* pub const $name: u32 = $value;)*

        /// Name and value of each constant: the macros of GLSL.
        pub const CONSTANTS: &[(&str, u32)] = &[$((stringify!($name), $name)),*];
    };
}

/// Declares an enum whose variants are numbers to the kernels, and its `NUMBERS`, the name and the number of each.
/// `SrcAlpha` of `BlendFactor` is `BLEND_FACTOR_SRC_ALPHA` in GLSL.
macro_rules! shared_enum {
    ($(#[$meta:meta])* pub enum $name:ident {
        $($(#[$of_variant:meta])* $variant:ident = $number:expr,)*
    }) => {
        $(#[$meta])*
        #[repr(u32)]
        pub enum $name {
            $($(#[$of_variant])* $variant = $number,)*
        }

        impl $name {
            /// Name and number of each variant.
            pub const NUMBERS: &[(&str, u32)] =
                &[$((concat!(stringify!($name), "::", stringify!($variant)), $number)),*];

            /// All variants.
            #[allow(dead_code)]
            pub const ALL: &[Self] = &[$($name::$variant),*];
        }
    };
}
