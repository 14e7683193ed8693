//! What an operation on constants gives: booleans and integers of 32 bits, which wrap around.
//!
//! Where SPIR-V leaves a result undefined (a division by zero, a shift by more bits than there are), there is none here, and
//! the operation stays.

use rspirv::spirv::Op;

/// A constant. Its type says whether the bits have a sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Value {
    Bool(bool),
    Int(u32),
}

use Value::{Bool, Int};

/// The result of `op`, if it is one of those known here.
pub fn evaluate(op: Op, operands: &[Value]) -> Option<Value> {
    match *operands {
        [Bool(a)] => (op == Op::LogicalNot).then_some(Bool(!a)),
        [Int(a)] => unary(op, a).map(Int),
        [Bool(a), Bool(b)] => logical(op, a, b).map(Bool),
        [Int(a), Int(b)] => compare(op, a, b)
            .map(Bool)
            .or_else(|| arithmetic(op, a, b).or(bitwise(op, a, b)).map(Int)),
        [Bool(first), a, b] if op == Op::Select => Some(if first { a } else { b }),
        [Int(base), Int(offset), Int(count)] => extract(op, base, offset, count).map(Int),
        [Int(base), Int(insert), Int(offset), Int(count)] if op == Op::BitFieldInsert => {
            let mask = field(offset, count)?;
            Some(Int(base & !mask | insert.checked_shl(offset).unwrap_or(0) & mask))
        }
        _ => None,
    }
}

/// The result of `op` if `known` decides it, whichever of the two operands it is.
pub fn decided(op: Op, known: Value) -> Option<Value> {
    match (op, known) {
        (Op::LogicalAnd, Bool(false)) | (Op::LogicalOr, Bool(true)) => Some(known),
        _ => None,
    }
}

fn unary(op: Op, a: u32) -> Option<u32> {
    Some(match op {
        Op::Not => !a,
        Op::SNegate => a.wrapping_neg(),
        Op::Bitcast | Op::CopyObject => a,
        Op::BitCount => a.count_ones(),
        Op::BitReverse => a.reverse_bits(),
        _ => return None,
    })
}

fn logical(op: Op, a: bool, b: bool) -> Option<bool> {
    Some(match op {
        Op::LogicalAnd => a && b,
        Op::LogicalOr => a || b,
        Op::LogicalEqual => a == b,
        Op::LogicalNotEqual => a != b,
        _ => return None,
    })
}

fn compare(op: Op, a: u32, b: u32) -> Option<bool> {
    let (signed_a, signed_b) = (a as i32, b as i32);
    Some(match op {
        Op::IEqual => a == b,
        Op::INotEqual => a != b,
        Op::ULessThan => a < b,
        Op::ULessThanEqual => a <= b,
        Op::UGreaterThan => a > b,
        Op::UGreaterThanEqual => a >= b,
        Op::SLessThan => signed_a < signed_b,
        Op::SLessThanEqual => signed_a <= signed_b,
        Op::SGreaterThan => signed_a > signed_b,
        Op::SGreaterThanEqual => signed_a >= signed_b,
        _ => return None,
    })
}

fn arithmetic(op: Op, a: u32, b: u32) -> Option<u32> {
    let (signed_a, signed_b) = (a as i32, b as i32);
    Some(match op {
        Op::IAdd => a.wrapping_add(b),
        Op::ISub => a.wrapping_sub(b),
        Op::IMul => a.wrapping_mul(b),
        Op::UDiv => a.checked_div(b)?,
        Op::UMod => a.checked_rem(b)?,
        Op::SDiv => signed_a.checked_div(signed_b)? as u32,
        Op::SRem => signed_a.checked_rem(signed_b)? as u32,
        // The sign is that of the divisor.
        Op::SMod => match signed_a.checked_rem(signed_b)? {
            rest if rest != 0 && (rest < 0) != (signed_b < 0) => (rest + signed_b) as u32,
            rest => rest as u32,
        },
        _ => return None,
    })
}

fn bitwise(op: Op, a: u32, b: u32) -> Option<u32> {
    Some(match op {
        Op::BitwiseAnd => a & b,
        Op::BitwiseOr => a | b,
        Op::BitwiseXor => a ^ b,
        Op::ShiftLeftLogical => a.checked_shl(b)?,
        Op::ShiftRightLogical => a.checked_shr(b)?,
        Op::ShiftRightArithmetic => (a as i32).checked_shr(b)? as u32,
        _ => return None,
    })
}

fn extract(op: Op, base: u32, offset: u32, count: u32) -> Option<u32> {
    let mask = field(offset, count)?;
    let bits = (base & mask).checked_shr(offset).unwrap_or(0);
    match op {
        Op::BitFieldUExtract => Some(bits),
        Op::BitFieldSExtract if count == 0 => Some(0),
        Op::BitFieldSExtract => {
            let unused = 32 - count;
            Some(((bits << unused) as i32 >> unused) as u32)
        }
        _ => None,
    }
}

/// `count` bits from `offset` on, if a word has them.
fn field(offset: u32, count: u32) -> Option<u32> {
    let bits = u32::MAX.checked_shr(32u32.checked_sub(count)?).unwrap_or(0);
    (offset.checked_add(count)? <= 32).then(|| bits.checked_shl(offset).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NUMBERS: [u32; 12] =
        [0, 1, 2, 3, 7, 31, 32, 33, 0x7fff_ffff, 0x8000_0000, 0xdead_beef, u32::MAX];

    /// What an operation gives in numbers without limits; `None` where SPIR-V leaves that open.
    type Wide = fn(i64, i64) -> Option<i64>;

    /// Whether the quotient of signed numbers exists.
    fn fits(a: i64, b: i64) -> bool {
        b != 0 && (a, b) != (i64::from(i32::MIN), -1)
    }

    fn agree(op: Op, signed: bool, wide: Wide) {
        let widen = |n: u32| if signed { i64::from(n as i32) } else { i64::from(n) };
        for (a, b) in NUMBERS.iter().flat_map(|a| NUMBERS.map(|b| (*a, b))) {
            let wanted = wide(widen(a), widen(b)).map(|n| Int(n as u32));
            assert_eq!(evaluate(op, &[Int(a), Int(b)]), wanted, "{op:?} {a} {b}");
        }
    }

    #[test]
    fn arithmetic_wraps_around() {
        for signed in [false, true] {
            agree(Op::IAdd, signed, |a, b| Some(a + b));
            agree(Op::ISub, signed, |a, b| Some(a - b));
            agree(Op::IMul, signed, |a, b| Some(a.wrapping_mul(b)));
            agree(Op::BitwiseAnd, signed, |a, b| Some(a & b));
            agree(Op::BitwiseOr, signed, |a, b| Some(a | b));
            agree(Op::BitwiseXor, signed, |a, b| Some(a ^ b));
        }
        agree(Op::UDiv, false, |a, b| (b != 0).then(|| a / b));
        agree(Op::UMod, false, |a, b| (b != 0).then(|| a % b));
        agree(Op::SDiv, true, |a, b| fits(a, b).then(|| a / b));
        agree(Op::SRem, true, |a, b| fits(a, b).then(|| a % b));
        agree(Op::SMod, true, |a, b| fits(a, b).then(|| (a % b + b) % b));
        agree(Op::ShiftLeftLogical, false, |a, b| (b < 32).then(|| a << b));
        agree(Op::ShiftRightLogical, false, |a, b| (b < 32).then(|| a >> b));
    }

    #[test]
    fn comparisons_see_the_sign_that_they_are_for() {
        let holds = |op, a, b| evaluate(op, &[Int(a), Int(b)]) == Some(Bool(true));
        for (a, b) in NUMBERS.iter().flat_map(|a| NUMBERS.map(|b| (*a, b))) {
            let (signed_a, signed_b) = (a as i32, b as i32);
            let wanted = [
                (Op::IEqual, a == b),
                (Op::INotEqual, a != b),
                (Op::ULessThan, a < b),
                (Op::ULessThanEqual, a <= b),
                (Op::UGreaterThan, a > b),
                (Op::UGreaterThanEqual, a >= b),
                (Op::SLessThan, signed_a < signed_b),
                (Op::SLessThanEqual, signed_a <= signed_b),
                (Op::SGreaterThan, signed_a > signed_b),
                (Op::SGreaterThanEqual, signed_a >= signed_b),
            ];
            for (op, wanted) in wanted {
                assert_eq!(holds(op, a, b), wanted, "{op:?} {a} {b}");
            }
            let shifted = (b < 32).then(|| Int((signed_a >> b.min(31)) as u32));
            assert_eq!(evaluate(Op::ShiftRightArithmetic, &[Int(a), Int(b)]), shifted, "{a} {b}");
        }
    }

    #[test]
    fn fields_of_bits_end_inside_the_word() {
        for base in NUMBERS {
            for (offset, count) in
                (0..34).flat_map(|offset| (0..34).map(move |count| (offset, count)))
            {
                let is_inside = offset + count <= 32;
                let mask = ((1u64 << count) - 1) << offset;
                let bits = (u64::from(base) & mask) >> offset;
                let negative = count > 0 && bits >> (count - 1) & 1 == 1;
                let signed = if negative { bits | u64::MAX << count } else { bits };
                let inserted = u64::from(base) & !mask | 0x1234_5678 << offset & mask;
                let operands = [Int(base), Int(offset), Int(count)];
                let wanted = |bits: u64| is_inside.then_some(Int(bits as u32));
                let what = format!("{base} {offset} {count}");
                assert_eq!(evaluate(Op::BitFieldUExtract, &operands), wanted(bits), "{what}");
                assert_eq!(evaluate(Op::BitFieldSExtract, &operands), wanted(signed), "{what}");
                let operands = [Int(base), Int(0x1234_5678), Int(offset), Int(count)];
                assert_eq!(evaluate(Op::BitFieldInsert, &operands), wanted(inserted), "{what}");
            }
        }
    }

    #[test]
    fn truths_are_decided() {
        let both = |op, a, b| evaluate(op, &[Bool(a), Bool(b)]);
        for (a, b) in [(false, false), (false, true), (true, false), (true, true)] {
            assert_eq!(both(Op::LogicalAnd, a, b), Some(Bool(a & b)));
            assert_eq!(both(Op::LogicalOr, a, b), Some(Bool(a | b)));
            assert_eq!(both(Op::LogicalEqual, a, b), Some(Bool(a == b)));
            assert_eq!(both(Op::LogicalNotEqual, a, b), Some(Bool(a != b)));
            assert_eq!(decided(Op::LogicalAnd, Bool(a)), (!a).then_some(Bool(false)));
            assert_eq!(decided(Op::LogicalOr, Bool(a)), a.then_some(Bool(true)));
            let chosen = if a { 1 } else { 2 };
            assert_eq!(evaluate(Op::Select, &[Bool(a), Int(1), Int(2)]), Some(Int(chosen)));
        }
        assert_eq!(evaluate(Op::FAdd, &[Int(1), Int(2)]), None);
        assert_eq!(evaluate(Op::LogicalNot, &[Int(1)]), None);
    }
}
