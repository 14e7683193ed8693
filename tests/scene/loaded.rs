//! Small files written on the spot: each shows one rule of a format.
