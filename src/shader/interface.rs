//! `in` and `out` variables, flattened to locations.
//!
//! A varying may be a matrix, an array, a struct or a block of all of these. Between the stages there are
//! locations, each with up to four 32-bit components. A [`Leaf`] is the part of a variable that lies at one
//! location, with the path to it inside the variable. Locations are counted by Vulkan's rules: a matrix takes
//! one location per column, the elements of an array take locations one after the other, and a member of a
//! block follows the member before it unless it names its own location.

use super::{
    Auxiliary, Interpolation, Scalar, Varying,
    module::{Index, Outcome, ids},
    usage::Usage,
};
use crate::abi;
use rspirv::{
    dr::Instruction,
    spirv::{BuiltIn, Decoration, Op, StorageClass, Word},
};
use std::collections::HashMap;

/// One location of a variable.
#[derive(Clone, Debug)]
pub(super) struct Leaf {
    /// Literal indices from the variable to the leaf.
    pub path: Vec<u32>,
    /// Type of the leaf: a scalar or a vector.
    pub ty: Word,
    /// The varying, as the other stage sees it.
    pub varying: Varying,
}

/// Values that the pipeline sets for specialization constants, which may be lengths of arrays.
pub(super) type Specialization<'a> = &'a [(u32, u32)];

/// An `in` or `out` variable.
#[derive(Clone, Debug)]
pub(super) enum Variable {
    /// One built-in.
    BuiltIn(BuiltIn),
    /// A block of built-ins (`gl_PerVertex`): by member.
    BuiltInBlock(Vec<BuiltIn>),
    /// A user's variable or block.
    Leaves(Vec<Leaf>),
    /// `gl_ClipDistance` or `gl_CullDistance`.
    Distances(BuiltIn, Vec<Leaf>),
}

/// Classifies and flattens the variable that `instruction` declares.
pub(super) fn variable(
    index: &Index,
    instruction: &Instruction,
    specialization: Specialization,
) -> Outcome<Variable> {
    let (Some(id), Some(pointer)) = (instruction.result_id, instruction.result_type) else {
        return Err("not a SPIR-V module: a variable without type".into());
    };
    let (_, ty) = index.pointer(pointer)?;
    if let Some(built_in) = index.built_in(id, None) {
        return Ok(match is_distance(built_in) {
            true => {
                let has = |decoration| index.has(id, decoration);
                if interpolation(has).is_some() || auxiliary(has).is_some() {
                    return Err(format!(
                        "the built-in {built_in:?} with an interpolation of its own"
                    ));
                }
                let leaves = distances(index, ty, built_in, (&[], specialization))?;
                Variable::Distances(built_in, leaves)
            }
            false => Variable::BuiltIn(built_in),
        });
    }
    if index.op(ty)? == Op::TypeStruct && index.built_in(ty, Some(0)).is_some() {
        let members = 0..index.def(ty)?.operands.len() as u32;
        let block: Option<Vec<_>> = members.map(|m| index.built_in(ty, Some(m))).collect();
        let mixed = "a block that mixes built-ins with user variables";
        return block.map(Variable::BuiltInBlock).ok_or_else(|| mixed.into());
    }
    if index.has(id, Decoration::PerVertexKHR) {
        return Err("inputs per vertex (pervertexEXT)".into());
    }
    let mut flatten = Flatten {
        index,
        specialization,
        hollow: HashMap::new(),
        path: Vec::new(),
        leaves: Vec::new(),
        source: index.literal(id, Decoration::Index).unwrap_or(0),
    };
    let component = index.literal(id, Decoration::Component).unwrap_or(0);
    let has = |decoration| index.has(id, decoration);
    let interpolation = interpolation(has).unwrap_or(Interpolation::Smooth);
    let location = index.literal(id, Decoration::Location);
    let located = location.is_some() || index.member_literal(ty, 0, Decoration::Location).is_some();
    if !located {
        return Err("an `in` or `out` variable without a location".into());
    }
    flatten.walk(ty, location.unwrap_or(0), component, (interpolation, auxiliary(has)))?;
    Ok(Variable::Leaves(flatten.leaves))
}

/// Whether the built-in is a list of distances from planes: those that clip primitives or those that cull them.
pub(super) fn is_distance(built_in: BuiltIn) -> bool {
    matches!(built_in, BuiltIn::ClipDistance | BuiltIn::CullDistance)
}

/// The elements of an array of distances at `path`. Kernels have distances at locations of their own: those of clipping from
/// the first place on, those of culling from the last place back. So neither has to know how many the other are.
fn distances(
    index: &Index,
    ty: Word,
    built_in: BuiltIn,
    (path, specialization): (&[u32], Specialization),
) -> Outcome<Vec<Leaf>> {
    if index.op(ty)? != Op::TypeArray {
        return Err(format!("the built-in {built_in:?} with an unusual type"));
    }
    let element = index.id_operand(ty, 0)?;
    let count = length(index, index.id_operand(ty, 1)?, specialization)?;
    let most = abi::MAX_DISTANCES;
    if count > most {
        return Err(format!("{count} elements of the built-in {built_in:?}; there are {most}"));
    }
    let leaf = |n: u32| {
        let place = if built_in == BuiltIn::ClipDistance { n } else { most - 1 - n };
        let varying = Varying {
            location: abi::DISTANCE_LOCATION + place / 4,
            component: place % 4,
            count: 1,
            scalar: Scalar::Float,
            interpolation: Interpolation::Smooth,
            auxiliary: None,
            index: 0,
        };
        Leaf { path: [path, &[n]].concat(), ty: element, varying }
    };
    Ok((0..count).map(leaf).collect())
}

/// The distances among the `members` of a block of built-ins that are used.
pub(super) fn distances_of_block(
    (index, usage): (&Index, &Usage),
    (variable, ty): (Word, Word),
    members: &[BuiltIn],
    specialization: Specialization,
) -> Outcome<Vec<(BuiltIn, Vec<Leaf>)>> {
    let mut found = Vec::new();
    for (n, &built_in) in members.iter().enumerate() {
        let member = n as u32;
        if is_distance(built_in) && usage.uses_member(index, variable, member) {
            let ty = index.id_operand(ty, n)?;
            let at = (&[member][..], specialization);
            found.push((built_in, distances(index, ty, built_in, at)?));
        }
    }
    Ok(found)
}

fn interpolation(has: impl Fn(Decoration) -> bool) -> Option<Interpolation> {
    if has(Decoration::Flat) {
        Some(Interpolation::Flat)
    } else if has(Decoration::NoPerspective) {
        Some(Interpolation::NoPerspective)
    } else {
        None
    }
}

fn auxiliary(has: impl Fn(Decoration) -> bool) -> Option<Auxiliary> {
    if has(Decoration::Sample) {
        Some(Auxiliary::Sample)
    } else if has(Decoration::Centroid) {
        Some(Auxiliary::Centroid)
    } else {
        None
    }
}

struct Flatten<'i, 'm> {
    index: &'i Index<'m>,
    specialization: Specialization<'i>,
    /// Types, and whether they hold nothing: structs without members, arrays of these, structs of these.
    hollow: HashMap<Word, bool>,
    path: Vec<u32>,
    leaves: Vec<Leaf>,
    /// The index of an output.
    source: u32,
}

impl Flatten<'_, '_> {
    /// Whether a value of type `ty` has no leaf. Such values are passed over: there may be any number of them
    /// inside each other, while every walk to a leaf brings the limit of locations nearer.
    fn is_hollow(&mut self, ty: Word) -> Outcome<bool> {
        if let Some(&known) = self.hollow.get(&ty) {
            return Ok(known);
        }
        let hollow = match self.index.op(ty)? {
            Op::TypeArray => self.is_hollow(self.index.id_operand(ty, 0)?)?,
            Op::TypeStruct => {
                let mut hollow = true;
                for member in ids(self.index.def(ty)?) {
                    hollow &= self.is_hollow(member)?;
                }
                hollow
            }
            _ => false,
        };
        self.hollow.insert(ty, hollow);
        Ok(hollow)
    }

    /// Adds the leaves of a value of type `ty` at `location`; returns the locations it takes.
    fn walk(
        &mut self,
        ty: Word,
        location: u32,
        component: u32,
        (interpolation, auxiliary): (Interpolation, Option<Auxiliary>),
    ) -> Outcome<u32> {
        // No device has as many locations; the limit keeps a hostile module from filling memory.
        if self.leaves.len() >= 256 || location >= 256 {
            return Err("more than 256 locations".into());
        }
        if self.is_hollow(ty)? {
            return Ok(0);
        }
        let index = self.index;
        match index.op(ty)? {
            Op::TypeFloat | Op::TypeInt | Op::TypeVector | Op::TypeBool => {
                let (scalar, count) = leaf_type(index, ty)?;
                if component.checked_add(count).is_none_or(|end| end > 4) {
                    return Err(
                        "a variable that reaches beyond its location's four components".into()
                    );
                }
                let interpolation =
                    if scalar == Scalar::Float { interpolation } else { Interpolation::Flat };
                let source = self.source;
                if source > 1 || source == 1 && location != 0 {
                    return Err(format!(
                        "an output with location {location} and index {source}: a second source of blending has location 0 and index 1"
                    ));
                }
                let varying = Varying {
                    location,
                    component,
                    count,
                    scalar,
                    interpolation,
                    auxiliary,
                    index: source,
                };
                self.leaves.push(Leaf { path: self.path.clone(), ty, varying });
                Ok(1)
            }
            Op::TypeMatrix | Op::TypeArray => {
                let element = index.id_operand(ty, 0)?;
                let count = match index.op(ty)? {
                    Op::TypeMatrix => index.number(ty, 1)?,
                    _ => length(index, index.id_operand(ty, 1)?, self.specialization)?,
                };
                if count > 256 {
                    return Err("more than 256 locations".into());
                }
                let mut used = 0;
                for n in 0..count {
                    self.path.push(n);
                    let how = (interpolation, auxiliary);
                    used += self.walk(element, location + used, component, how)?;
                    self.path.pop();
                }
                Ok(used)
            }
            Op::TypeStruct => {
                let mut next = location;
                for (n, member) in ids(index.def(ty)?).enumerate() {
                    let n = n as u32;
                    if self.is_hollow(member)? {
                        continue;
                    }
                    if index.member_has(ty, n, Decoration::PerVertexKHR) {
                        return Err("inputs per vertex (pervertexEXT)".into());
                    }
                    let at = |decoration| index.member_literal(ty, n, decoration);
                    next = at(Decoration::Location).unwrap_or(next);
                    let component = at(Decoration::Component).unwrap_or(0);
                    let has = |decoration| index.member_has(ty, n, decoration);
                    let own = self::interpolation(has).unwrap_or(interpolation);
                    let how = (own, self::auxiliary(has).or(auxiliary));
                    self.path.push(n);
                    next += self.walk(member, next, component, how)?;
                    self.path.pop();
                }
                Ok(next.saturating_sub(location))
            }
            other => Err(format!("an `in` or `out` variable of Op{other:?}")),
        }
    }
}

/// Component kind and count of a scalar or vector that may cross between stages.
pub(super) fn leaf_type(index: &Index, ty: Word) -> Outcome<(Scalar, u32)> {
    let (scalar, count) = match index.op(ty)? {
        Op::TypeVector => (index.id_operand(ty, 0)?, index.number(ty, 1)?),
        _ => (ty, 1),
    };
    let kind = match index.op(scalar)? {
        Op::TypeFloat => Scalar::Float,
        Op::TypeInt if index.number(scalar, 1)? == 1 => Scalar::Int,
        Op::TypeInt => Scalar::Uint,
        other => return Err(format!("an `in` or `out` variable of Op{other:?}")),
    };
    match index.number(scalar, 0)? {
        32 => Ok((kind, count)),
        bits => Err(format!("`in` and `out` variables of {bits} bits")),
    }
}

/// The length of an array. A specialization constant's default counts, since reflection knows no other;
/// a pipeline that sets another value is refused.
pub(super) fn length(index: &Index, id: Word, specialization: Specialization) -> Outcome<u32> {
    let default = index.constant(id)?;
    let constant = index.literal(id, Decoration::SpecId);
    match constant.and_then(|c| specialization.iter().find(|&&(id, _)| id == c)) {
        _ if default == 0 => Err("an array of no elements".into()),
        Some(&(constant, value)) if value != default => Err(format!(
            "an `in` or `out` array whose length the specialization constant {constant} changes \
             from {default} to {value}"
        )),
        _ => Ok(default),
    }
}

/// Whether the storage class is that of varyings and built-ins.
pub(super) fn is_interface(class: StorageClass) -> bool {
    matches!(class, StorageClass::Input | StorageClass::Output)
}
