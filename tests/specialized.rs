//! Does a kernel compute the same with a constant that is specialized as with one that its source has?

use crate::common::{kernel_spirv, on_each_gpu};
use tilewright::vk::{Buffer, Gpu, Kernel, KernelInfo, Memory, Recorder};

/// Invocations of a case: each is given its own number.
const INVOCATIONS: usize = 24;

/// Control flow that constants decide in part. `x` is the invocation's number, `r` is what it gives.
const CASES: &[&str] = &[
    "if (A == 1u) r = x; else if (D && x > 3u) r = 2u; else r = A - 1u;",
    "r = (D && x > 4u) || (A == 2u && x > 8u) ? 5u : x;",
    "switch (A) { case 1u: r += 1u; case 2u: r += 2u; break; case 3u: if (x > 5u) break; r += 9u; break; default: r = 7u; } r += x;",
    "switch (x % 4u) { case 0u: if (D) break; r = 1u; case 1u: r += 2u; if (A == 1u) { r += 1u; break; } case 2u: r += 4u; }",
    "for (uint i = 0u; i < x; i++) { if (D) continue; r += i; if (A == 2u) break; r += 1u; }",
    "for (uint i = 0u; i < A; i++) { if (A == 2u) { if (i == x) break; if (D) { r += 7u; continue; } } r += i; }",
    "uint i = 0u; do { r += A; i++; if (D) continue; i++; } while (A != 2u && i < x);",
    "for (uint i = 0u;; i++) { switch (A) { case 1u: r += 3u; break; case 2u: if (i > x) break; r++; continue; default: r = f(x, i); }
        if (i > 9u) break; }",
    "for (uint i = 0u; i < x; i++) { for (uint k = 0u; k < x; k++) { if (A == 1u) { if (k == 3u) break; if (D) continue; }
        r += i ^ k; } if (!D && i > 4u) break; }",
    "r = f(x, A) + (D ? f(3u, x) : x << (A & 31u)); if (!D) { if (x > 6u) r = 1u; }",
    "r = uint(int(x) - B) >> 1; r ^= uint(B / int(A + 1u)) + uint(-B ^ 3) + bitfieldExtract(A * 77u, 2, 3);",
];

/// The values of `A`, `B` and `D`.
const VALUES: [(u32, i32, bool); 6] =
    [(0, 8, true), (1, -7, false), (1, 0, true), (2, 5, true), (2, i32::MAX, false), (3, -1, true)];

/// A function that returns from several places.
const FUNCTION: &str = "uint f(uint a, uint b) {
    if (A == 1u) return a * 3u;
    if (A == 2u) { if (a > b) return 5u; } else if (!D) return b;
    uint sum = 0u;
    while (sum < a) { if (D && sum > b) return sum; sum += 2u; }
    return sum + 100u;
}";

/// What a kernel of all cases gives with `declarations` of constants: the numbers of one case after those of another.
fn numbers(gpu: &Gpu, declarations: &str, constants: &[(&str, u32)]) -> Vec<u32> {
    let (mut functions, mut calls) = (String::new(), String::new());
    for (n, body) in CASES.iter().enumerate() {
        functions += &format!("uint case_{n}(uint x) {{ uint r = 0u; {body} return r; }}\n");
        calls += &format!("numbers[{n} * {INVOCATIONS} + x] = case_{n}(x);\n");
    }
    let spirv = kernel_spirv(&format!(
        "#version 460
        layout(local_size_x = 4) in;
        layout(binding = 0) buffer Numbers {{ uint numbers[]; }};
        {declarations}
        {FUNCTION}
        {functions}
        void main() {{ uint x = gl_GlobalInvocationID.x; {calls} }}"
    ));
    let info = KernelInfo::new("specialized", &spirv).constants(constants);
    let kernel = Kernel::new(gpu, &info).unwrap_or_else(|e| panic!("{e}"));
    let numbers =
        Buffer::<u32>::new(gpu, "numbers", CASES.len() * INVOCATIONS, Memory::Device).unwrap();
    let mut recorder = Recorder::new(gpu, "specialized").unwrap();
    let groups = [INVOCATIONS as u32 / 4, 1, 1];
    recorder.kernel(&kernel).bind("Numbers", &numbers).dispatch(groups).unwrap();
    let numbers = recorder.download(&numbers).unwrap();
    recorder.submit().unwrap();
    numbers.read().unwrap()
}

#[test]
fn specialized_kernels_compute_what_their_constants_say() {
    on_each_gpu("specialized kernels", |gpu| {
        for (a, b, d) in VALUES {
            let specialized = "layout(constant_id = 3) const uint A = 55;
                layout(constant_id = 9) const int B = 56;
                layout(constant_id = 4) const bool D = false;";
            let written = format!("const uint A = {a}u; const int B = {b}; const bool D = {d};");
            let constants = [("A", a), ("B", b as u32), ("D", u32::from(d))];
            let found = numbers(gpu, specialized, &constants);
            let wanted = numbers(gpu, &written, &[]);
            let pairs = found.chunks(INVOCATIONS).zip(wanted.chunks(INVOCATIONS));
            for (body, (found, wanted)) in CASES.iter().zip(pairs) {
                assert_eq!(found, wanted, "{}: {body} with {a}, {b}, {d}", gpu.info());
            }
        }
    });
}
