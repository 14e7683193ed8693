//! A macro for structs that will grow: users make them by a constructor and set what differs from it.

/// Declares for each field a method of the same name that returns the struct with that field set. A field after `into`
/// takes everything that becomes its type, a value for an `Option` for example, or an array for a `Vec`.
macro_rules! setters {
    ($($name:ident: $ty:ty,)* $(; into $($into:ident: $into_ty:ty,)*)?) => {
        $(
            #[doc = concat!("The same with this [`", stringify!($name), "`](#structfield.", stringify!($name), ").")]
            #[must_use]
            pub const fn $name(mut self, $name: $ty) -> Self {
                self.$name = $name;
                self
            }
        )*
        $($(
            #[doc = concat!("The same with this [`", stringify!($into), "`](#structfield.", stringify!($into), ").")]
            #[must_use]
            pub fn $into(mut self, $into: impl Into<$into_ty>) -> Self {
                self.$into = $into.into();
                self
            }
        )*)?
    };
}
