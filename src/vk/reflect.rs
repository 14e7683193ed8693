//! The bindings of a kernel, read from its SPIR-V, so that no binding number is ever typed twice.

use super::address::Addressed;
use crate::load_spirv::load;
use ash::vk;
use rspirv::{
    dr::{self, Operand},
    spirv::{BuiltIn, Decoration, ExecutionMode, Op, StorageClass, Word},
};
use std::collections::HashMap;

/// What kind of buffer a kernel binds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BindingKind {
    Storage,
    Uniform,
    /// By address, with its number in the block of addresses.
    Address(u32),
}

/// One block of descriptor set 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BlockBinding {
    /// The block's instance name in the kernel.
    pub name: String,
    pub binding: u32,
    pub kind: BindingKind,
    /// Bytes from one element to the next, if the block is nothing but one run-time array.
    pub stride: Option<u32>,
}

/// What reflection found in a kernel.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct KernelReflection {
    /// Set 0, sorted by binding.
    pub bindings: Vec<BlockBinding>,
    /// Whether it uses the resource table, set 1.
    pub uses_table: bool,
    /// Binding of the block of addresses, if it has one, and how many there are; the last may be that of
    /// the table of addresses.
    pub addresses: Option<(u32, u32)>,
    pub table_address: bool,
    pub push_constant_bytes: u32,
    /// Bytes that a workgroup shares.
    pub shared_bytes: u64,
    pub workgroup: [u32; 3],
    /// Specialization constants: name, id and size in bytes (booleans have 4).
    pub constants: Vec<(String, u32)>,
}

impl KernelReflection {
    /// The descriptors of set 0: bindings and types.
    pub fn descriptors(&self) -> impl Iterator<Item = (u32, vk::DescriptorType)> {
        let of = |b: &BlockBinding| match b.kind {
            BindingKind::Storage => Some((b.binding, vk::DescriptorType::STORAGE_BUFFER)),
            BindingKind::Uniform => Some((b.binding, vk::DescriptorType::UNIFORM_BUFFER)),
            BindingKind::Address(_) => None,
        };
        let addresses = self.addresses.iter();
        let addresses =
            addresses.map(|&(binding, _)| (binding, vk::DescriptorType::UNIFORM_BUFFER));
        self.bindings.iter().filter_map(of).chain(addresses)
    }

    /// Notes which blocks were replaced by addresses.
    pub fn replaced(&mut self, addressed: &Addressed) {
        for (n, binding) in addressed.blocks.iter().enumerate() {
            if let Some(block) = self.bindings.iter_mut().find(|b| b.binding == *binding) {
                block.kind = BindingKind::Address(n as u32);
            }
        }
        let count = addressed.blocks.len() as u32 + u32::from(addressed.table);
        self.addresses = Some((addressed.binding, count));
        self.table_address = addressed.table;
        self.uses_table = addressed.uses_table;
    }
}

/// Reads a kernel whose specialization constants have the values `specialized` (by id).
pub(super) fn reflect(
    words: &[u32],
    specialized: &HashMap<u32, u32>,
) -> std::result::Result<KernelReflection, String> {
    if has(words, Op::ExecutionModeId) {
        return Err("has its workgroup size from constants (`LocalSizeId`), as compilers for Vulkan 1.3 write it; \
                    compile it for Vulkan 1.2 (`--target-env vulkan1.2`)"
            .into());
    }
    let module = load(words).map_err(|e| format!("is no SPIR-V module: {e}"))?;
    let m = Module::index(&module, specialized);
    let mut found = KernelReflection { workgroup: m.workgroup()?, ..Default::default() };
    for variable in module.types_global_values.iter().filter(|i| i.class.opcode == Op::Variable) {
        let id = variable.result_id.unwrap_or_default();
        let Some(pointer) = variable.result_type.and_then(|t| m.types.get(&t)) else { continue };
        let Some(&Operand::StorageClass(class)) = variable.operands.first() else { continue };
        let pointee = word(pointer, 1);
        if class == StorageClass::Workgroup {
            found.shared_bytes = found.shared_bytes.saturating_add(m.scalar_bytes(pointee));
            continue;
        }
        if class == StorageClass::PushConstant {
            found.push_constant_bytes = m.size(pointee)?;
            continue;
        }
        let name = || {
            let names = [id, pointee].into_iter().filter_map(|id| m.names.get(&id).copied());
            names.into_iter().find(|name| !name.is_empty()).unwrap_or("")
        };
        let resource =
            [StorageClass::UniformConstant, StorageClass::Uniform, StorageClass::StorageBuffer];
        let Some(set) = m.decoration(id, Decoration::DescriptorSet) else {
            if resource.contains(&class) {
                return Err(format!("declares `{}` without a descriptor set of its own", name()));
            }
            continue;
        };
        let binding = m.decoration(id, Decoration::Binding).unwrap_or(0);
        match set {
            1 if m.fits_table(class, pointee, binding) => found.uses_table = true,
            1 => {
                let name = name();
                return Err(format!(
                    "declares `{name}` as binding {binding} of set 1, which is the resource table and has other \
                     kinds there: blocks of its own belong to set 0"
                ));
            }
            0 if m.is_array(pointee) => {
                return Err(format!(
                    "binds `{}`, an array of blocks, in set 0; arrays of blocks are in binding 4 of the resource table, \
                     which is set 1",
                    name()
                ));
            }
            0 => {
                let kind = match class {
                    StorageClass::StorageBuffer => BindingKind::Storage,
                    StorageClass::Uniform if m.has(pointee, Decoration::BufferBlock) => {
                        BindingKind::Storage
                    }
                    StorageClass::Uniform => BindingKind::Uniform,
                    _ => {
                        return Err(format!(
                            "binds `{}`, an image or a sampler, in set 0, which is for blocks; those come from a \
                             resource table, which is set 1 (see `ResourceTable`)",
                            name()
                        ));
                    }
                };
                let name = [id, pointee]
                    .iter()
                    .filter_map(|id| m.names.get(id))
                    .find(|n| !n.is_empty())
                    .ok_or(format!(
                        "has no name for binding {binding} of set 0: compile it so that it keeps names (with `-g`, \
                         or without `-O`)"
                    ))?;
                found.bindings.push(BlockBinding {
                    name: name.to_string(),
                    binding,
                    kind,
                    stride: m.only_stride(pointee),
                });
            }
            set => return Err(format!("binds set {set}; kernels have sets 0 and 1")),
        }
    }
    found.bindings.sort_by_key(|b| b.binding);
    if let Some(pair) = found.bindings.windows(2).find(|p| p[0].binding == p[1].binding) {
        return Err(format!("binds `{}` and `{}` to one number", pair[0].name, pair[1].name));
    }
    for (&id, decorations) in &m.decorations {
        let spec = decorations.iter().find(|(d, _)| *d == Decoration::SpecId);
        if let Some(&(_, Some(spec))) = spec {
            let name = m.names.get(&id).copied().unwrap_or_default();
            found.constants.push((name.to_string(), spec));
        }
    }
    found.constants.sort_by_key(|c| c.1);
    Ok(found)
}

/// Decorations with their number, where they have one.
type Decorations = Vec<(Decoration, Option<u32>)>;

/// The module's tables that reflection looks things up in.
struct Module<'a> {
    module: &'a dr::Module,
    names: HashMap<Word, &'a str>,
    types: HashMap<Word, &'a dr::Instruction>,
    decorations: HashMap<Word, Decorations>,
    members: HashMap<(Word, u32), Decorations>,
    specialized: &'a HashMap<u32, u32>,
}

impl<'a> Module<'a> {
    fn index(module: &'a dr::Module, specialized: &'a HashMap<u32, u32>) -> Self {
        let mut names = HashMap::new();
        for i in &module.debug_names {
            if let (Op::Name, [Operand::IdRef(id), Operand::LiteralString(name)]) =
                (i.class.opcode, &i.operands[..])
            {
                names.insert(*id, name.as_str());
            }
        }
        let mut decorations = HashMap::<_, Vec<_>>::new();
        let mut members = HashMap::<_, Vec<_>>::new();
        for i in &module.annotations {
            match (i.class.opcode, &i.operands[..]) {
                (Op::Decorate, [Operand::IdRef(id), Operand::Decoration(d), rest @ ..]) => {
                    decorations.entry(*id).or_default().push((*d, literal(rest)));
                }
                (
                    Op::MemberDecorate,
                    [
                        Operand::IdRef(id),
                        Operand::LiteralBit32(m),
                        Operand::Decoration(d),
                        rest @ ..,
                    ],
                ) => members.entry((*id, *m)).or_default().push((*d, literal(rest))),
                _ => {}
            }
        }
        let types =
            module.types_global_values.iter().filter_map(|i| Some((i.result_id?, i))).collect();
        Self { module, names, types, decorations, members, specialized }
    }

    fn decoration(&self, id: Word, wanted: Decoration) -> Option<u32> {
        self.decorations.get(&id)?.iter().find(|(d, _)| *d == wanted)?.1
    }

    fn has(&self, id: Word, wanted: Decoration) -> bool {
        self.decorations.get(&id).is_some_and(|all| all.iter().any(|(d, _)| *d == wanted))
    }

    fn is_array(&self, ty: Word) -> bool {
        let array =
            |t: &&dr::Instruction| matches!(t.class.opcode, Op::TypeArray | Op::TypeRuntimeArray);
        self.types.get(&ty).is_some_and(array)
    }

    /// Whether the resource table has this kind of variable at `binding`. An image with its sampler serves as either.
    fn fits_table(&self, class: StorageClass, pointee: Word, binding: u32) -> bool {
        let Some(whole) = self.types.get(&pointee).copied() else { return false };
        let of_array = Some(whole).filter(|_| self.is_array(pointee));
        let of_array = of_array.and_then(|t| self.types.get(&word(t, 0)).copied());
        let element = of_array.unwrap_or(whole);
        match (class, element.class.opcode) {
            (StorageClass::StorageBuffer, Op::TypeStruct) => binding == 4,
            (StorageClass::UniformConstant, Op::TypeSampledImage) => binding == 0,
            (StorageClass::UniformConstant, Op::TypeSampler) => [0, 2].contains(&binding),
            // 2 stands for an image that is used without a sampler.
            (StorageClass::UniformConstant, Op::TypeImage) => match word(element, 5) {
                2 => binding == 3,
                _ => [0, 1].contains(&binding),
            },
            _ => false,
        }
    }

    /// The value of a constant, after specialization.
    fn constant(&self, id: Word) -> Option<u32> {
        let i = self.types.get(&id)?;
        let default = match i.operands.first() {
            Some(&Operand::LiteralBit32(value)) => value,
            _ => return None,
        };
        let spec = self.decoration(id, Decoration::SpecId);
        Some(spec.and_then(|s| self.specialized.get(&s).copied()).unwrap_or(default))
    }

    /// The workgroup size: the decorated built-in constant where there is one, else the mode.
    fn workgroup(&self) -> std::result::Result<[u32; 3], String> {
        let built_in = self.module.annotations.iter().find_map(|i| match i.operands[..] {
            [
                Operand::IdRef(id),
                Operand::Decoration(Decoration::BuiltIn),
                Operand::BuiltIn(BuiltIn::WorkgroupSize),
            ] => Some(id),
            _ => None,
        });
        if let Some(composite) = built_in.and_then(|id| self.types.get(&id)) {
            let sizes: Vec<_> = (0..composite.operands.len())
                .filter_map(|n| self.constant(word(composite, n)))
                .collect();
            if let [x, y, z] = sizes[..] {
                return Ok([x, y, z]);
            }
        }
        self.module
            .execution_modes
            .iter()
            .find_map(|i| match i.operands[..] {
                [
                    _,
                    Operand::ExecutionMode(ExecutionMode::LocalSize),
                    Operand::LiteralBit32(x),
                    Operand::LiteralBit32(y),
                    Operand::LiteralBit32(z),
                ] => Some([x, y, z]),
                _ => None,
            })
            .ok_or_else(|| "has no workgroup size: it is no compute kernel".into())
    }

    /// The stride of the run-time array that is a block's only member.
    fn only_stride(&self, block: Word) -> Option<u32> {
        let block = self.types.get(&block)?;
        let array = self.types.get(&word(block, 0))?;
        let only = block.operands.len() == 1 && array.class.opcode == Op::TypeRuntimeArray;
        only.then(|| self.decoration(array.result_id?, Decoration::ArrayStride)).flatten()
    }

    /// Bytes of all scalars of a type.
    fn scalar_bytes(&self, id: Word) -> u64 {
        let Some(t) = self.types.get(&id) else { return 0 };
        let of = |n: usize| self.scalar_bytes(word(t, n));
        match t.class.opcode {
            Op::TypeInt | Op::TypeFloat => u64::from(word(t, 0) / 8),
            Op::TypeBool => 4,
            Op::TypeVector | Op::TypeMatrix => of(0).saturating_mul(word(t, 1).into()),
            // A length that is not known here is the device's business.
            Op::TypeArray => of(0).saturating_mul(self.constant(word(t, 1)).unwrap_or(1).into()),
            Op::TypeStruct => (0..t.operands.len()).fold(0, |all, n| all.saturating_add(of(n))),
            _ => 0,
        }
    }

    /// Bytes of a type as laid out in a block.
    fn size(&self, id: Word) -> std::result::Result<u32, String> {
        let t = self.types.get(&id).ok_or("has an unknown type in a block")?;
        Ok(match t.class.opcode {
            Op::TypeInt | Op::TypeFloat => word(t, 0) / 8,
            Op::TypeVector => product(self.size(word(t, 0))?, word(t, 1))?,
            Op::TypeArray => {
                let stride = self.decoration(id, Decoration::ArrayStride);
                let length = self.constant(word(t, 1)).ok_or("has an array of unknown length")?;
                product(stride.ok_or("has an array without a stride")?, length)?
            }
            Op::TypeStruct => {
                let mut end = 0;
                for n in 0..t.operands.len() as u32 {
                    let of = |wanted| {
                        let all = self.members.get(&(id, n))?;
                        all.iter().find(|(d, _)| *d == wanted)?.1
                    };
                    let offset = of(Decoration::Offset).ok_or("has a block without offsets")?;
                    let size = match of(Decoration::MatrixStride) {
                        Some(stride) => product(stride, self.columns(word(t, n as usize)))?,
                        None => self.size(word(t, n as usize))?,
                    };
                    end = end.max(offset.checked_add(size).ok_or(TOO_LARGE)?);
                }
                end
            }
            op => return Err(format!("has an {op:?} in its push constants")),
        })
    }

    fn columns(&self, id: Word) -> u32 {
        self.types.get(&id).map_or(0, |t| word(t, 1))
    }
}

const TOO_LARGE: &str = "has a block of more than 4 GiB";

/// Whether a module has an instruction, before it is parsed.
fn has(words: &[u32], wanted: Op) -> bool {
    let mut at = 5; // behind the header
    while let Some(first) = words.get(at) {
        if first & 0xffff == wanted as u32 {
            return true;
        }
        at += (first >> 16).max(1) as usize;
    }
    false
}

/// The bytes of `count` elements of `bytes`.
fn product(bytes: u32, count: u32) -> std::result::Result<u32, String> {
    bytes.checked_mul(count).ok_or_else(|| TOO_LARGE.into())
}

/// Operand `n` as an id or a number, 0 if it is neither.
fn word(i: &dr::Instruction, n: usize) -> u32 {
    match i.operands.get(n) {
        Some(&(Operand::IdRef(w) | Operand::LiteralBit32(w))) => w,
        _ => 0,
    }
}

fn literal(operands: &[Operand]) -> Option<u32> {
    match operands.first() {
        Some(&Operand::LiteralBit32(value)) => Some(value),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compilers for Vulkan 1.3 write `OpExecutionModeId`, which the parser does not take.
    #[test]
    fn a_workgroup_size_from_constants_is_refused_with_the_way_out() {
        let mode = 6 << 16 | Op::ExecutionModeId as u32;
        let words = [0x0723_0203, 0x0001_0600, 0, 9, 0, mode, 1, 38, 2, 3, 4];
        let error = reflect(&words, &HashMap::new()).unwrap_err();
        assert!(error.contains("LocalSizeId") && error.contains("vulkan1.2"), "{error}");
    }

    /// A group of decorations is not looked into, so that the variable seems to have no set.
    #[cfg(any(feature = "glsl", feature = "glsl-bundled"))]
    #[test]
    fn a_resource_without_a_set_of_its_own_is_refused() {
        use rspirv::binary::Assemble as _;
        let source = "#version 460
            layout(local_size_x = 1) in;
            layout(set = 0, binding = 0) buffer Words { uint words[]; };
            void main() { words[0] = 1u; }";
        let mut module = load(&crate::shader::testing::kernel(source)).unwrap();
        let of_set = Operand::Decoration(Decoration::DescriptorSet);
        module.annotations.retain(|i| i.operands.get(1) != Some(&of_set));
        let error = reflect(&module.assemble(), &HashMap::new()).unwrap_err();
        assert!(error.contains("without a descriptor set") && error.contains("Words"), "{error}");
    }
}
