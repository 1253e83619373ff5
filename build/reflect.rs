//! Reads what the crate needs to know out of a SPIR-V module: bindings and their access, push constants,
//! specialization constants, group size, and the layout of every struct with explicit offsets.
//! Numbers are opcodes and enumerants of the SPIR-V 1.6 specification.

use std::collections::{BTreeMap, HashMap};

/// Kind of a descriptor, as far as Welkin uses them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    StorageBuffer,
    StorageImage,
    SampledImage,
    InputAttachment,
}

#[derive(Clone, PartialEq, Debug)]
pub struct Binding {
    pub name: String,
    pub binding: u32,
    pub kind: Kind,
    pub readable: bool,
    pub writable: bool,
    /// Index of an input attachment.
    pub attachment: Option<u32>,
}

#[derive(Clone, PartialEq, Debug)]
pub struct Layout {
    pub name: String,
    pub members: Vec<(String, u32)>,
    pub size: u32,
}

#[derive(Clone, Default, Debug)]
pub struct Reflection {
    pub bindings: Vec<Binding>,
    pub push_constant_size: u32,
    pub group_size: [u32; 3],
    pub spec_constants: Vec<(String, u32)>,
    pub layouts: Vec<Layout>,
    pub interlock: bool,
}

#[derive(Clone, Debug)]
enum Type {
    Scalar(u32),
    Vector(u32, u32),
    Matrix(u32, u32),
    Array(u32, u32),
    RuntimeArray(u32),
    Struct(Vec<u32>),
    Pointer(u32),
    Image { sampled: u32, dim: u32 },
    SampledImage,
}

#[derive(Default)]
struct Module {
    names: HashMap<u32, String>,
    member_names: HashMap<(u32, u32), String>,
    decorations: HashMap<(u32, u32), u32>,
    member_decorations: HashMap<(u32, u32, u32), u32>,
    types: BTreeMap<u32, Type>,
    constants: HashMap<u32, u32>,
}

const SPEC_ID: u32 = 1;
const ARRAY_STRIDE: u32 = 6;
const MATRIX_STRIDE: u32 = 7;
const NON_WRITABLE: u32 = 24;
const NON_READABLE: u32 = 25;
const BINDING: u32 = 33;
const DESCRIPTOR_SET: u32 = 34;
const OFFSET: u32 = 35;
const INPUT_ATTACHMENT_INDEX: u32 = 43;

pub fn reflect(words: &[u32]) -> Result<Reflection, String> {
    let mut m = Module::default();
    let mut out = Reflection { group_size: [1; 3], ..Reflection::default() };
    let mut variables = Vec::new();
    let mut at = 5;
    while at < words.len() {
        let (count, opcode) = ((words[at] >> 16) as usize, words[at] & 0xffff);
        let w = &words[at..at + count];
        match opcode {
            5 => drop(m.names.insert(w[1], text(&w[2..]))),
            6 => drop(m.member_names.insert((w[1], w[2]), text(&w[3..]))),
            16 if w[2] == 17 => out.group_size = [w[3], w[4], w[5]],
            16 if (5366..=5371).contains(&w[2]) => out.interlock = true,
            21 | 22 => drop(m.types.insert(w[1], Type::Scalar(w[2] / 8))),
            23 => drop(m.types.insert(w[1], Type::Vector(w[2], w[3]))),
            24 => drop(m.types.insert(w[1], Type::Matrix(w[2], w[3]))),
            25 => drop(m.types.insert(w[1], Type::Image { dim: w[3], sampled: w[7] })),
            27 => drop(m.types.insert(w[1], Type::SampledImage)),
            28 => drop(m.types.insert(w[1], Type::Array(w[2], w[3]))),
            29 => drop(m.types.insert(w[1], Type::RuntimeArray(w[2]))),
            30 => drop(m.types.insert(w[1], Type::Struct(w[2..].to_vec()))),
            32 => drop(m.types.insert(w[1], Type::Pointer(w[3]))),
            43 | 50 => drop(m.constants.insert(w[2], w[3])),
            59 => variables.push((w[1], w[2], w[3])),
            71 => drop(m.decorations.insert((w[1], w[2]), w.get(3).copied().unwrap_or(1))),
            72 => drop(m.member_decorations.insert((w[1], w[2], w[3]), w.get(4).copied().unwrap_or(1))),
            _ => {}
        }
        at += count;
    }

    for (pointer, id, class) in variables {
        let Some(Type::Pointer(pointee)) = m.types.get(&pointer) else { continue };
        match class {
            9 => out.push_constant_size = m.size(*pointee)?,
            0 | 2 | 12 if m.decorations.contains_key(&(id, BINDING)) => out.bindings.push(m.binding(id, *pointee)?),
            _ => {}
        }
    }
    out.bindings.sort_by_key(|binding| binding.binding);

    for (&(id, decoration), &value) in &m.decorations {
        if decoration == SPEC_ID {
            let name = m.names.get(&id).ok_or_else(|| format!("specialization constant {value} has no name"))?;
            out.spec_constants.push((name.clone(), value));
        }
    }
    out.spec_constants.sort_by_key(|(_, id)| *id);

    for (&id, ty) in &m.types {
        let Type::Struct(members) = ty else { continue };
        let Some(name) = m.names.get(&id).filter(|name| !name.is_empty()) else { continue };
        if members.is_empty() || !m.member_decorations.contains_key(&(id, 0, OFFSET)) || m.ends_unsized(members) {
            continue;
        }
        let named = (0..members.len() as u32).map(|i| (m.member_names[&(id, i)].clone(), m.offset(id, i)));
        out.layouts.push(Layout { name: name.clone(), members: named.collect(), size: m.stride(id)? });
    }
    Ok(out)
}

impl Module {
    fn binding(&self, id: u32, pointee: u32) -> Result<Binding, String> {
        let name = self.names.get(&id).filter(|name| !name.is_empty()).or_else(|| self.names.get(&pointee));
        let name = name.cloned().ok_or("a binding has no name")?;
        if self.decorations.get(&(id, DESCRIPTOR_SET)).copied().unwrap_or(0) != 0 {
            return Err(format!("binding {name} is not in set 0"));
        }
        let every_member = |decoration| match &self.types[&pointee] {
            Type::Struct(members) => {
                (0..members.len() as u32).all(|i| self.member_decorations.contains_key(&(pointee, i, decoration)))
            }
            _ => false,
        };
        let has = |decoration| self.decorations.contains_key(&(id, decoration)) || every_member(decoration);
        let kind = match &self.types[&pointee] {
            Type::Struct(_) => Kind::StorageBuffer,
            Type::Image { dim: 6, .. } => Kind::InputAttachment,
            Type::Image { sampled: 2, .. } => Kind::StorageImage,
            Type::SampledImage => Kind::SampledImage,
            other => return Err(format!("binding {name} has an unsupported type {other:?}")),
        };
        let sampled = matches!(kind, Kind::SampledImage | Kind::InputAttachment);
        Ok(Binding {
            name,
            binding: self.decorations[&(id, BINDING)],
            kind,
            readable: sampled || !has(NON_READABLE),
            writable: !sampled && !has(NON_WRITABLE),
            attachment: self.decorations.get(&(id, INPUT_ATTACHMENT_INDEX)).copied(),
        })
    }

    fn offset(&self, id: u32, member: u32) -> u32 {
        self.member_decorations.get(&(id, member, OFFSET)).copied().unwrap_or(0)
    }

    fn ends_unsized(&self, members: &[u32]) -> bool {
        members.iter().any(|member| matches!(self.types.get(member), Some(Type::RuntimeArray(_))))
    }

    /// Size of struct `id` rounded up to its std430 alignment: the distance between elements of an array of it.
    fn stride(&self, id: u32) -> Result<u32, String> {
        Ok(self.size(id)?.next_multiple_of(self.alignment(id)))
    }

    fn alignment(&self, id: u32) -> u32 {
        match &self.types[&id] {
            Type::Vector(element, count) => self.alignment(*element) * count.next_power_of_two(),
            Type::Matrix(element, _) | Type::Array(element, _) | Type::RuntimeArray(element) => {
                self.alignment(*element)
            }
            Type::Struct(members) => members.iter().map(|member| self.alignment(*member)).max().unwrap_or(4),
            _ => 4,
        }
    }

    fn size(&self, id: u32) -> Result<u32, String> {
        Ok(match self.types.get(&id).ok_or("unknown type")? {
            Type::Scalar(bytes) => *bytes,
            Type::Vector(element, count) => self.size(*element)? * count,
            Type::Matrix(column, count) => {
                let rows = self.size(*column)?;
                rows.next_multiple_of(if rows > 8 { 16 } else { 8 }) * count
            }
            Type::Array(_, length) => {
                let length = self.constants.get(length).ok_or("array length is not a constant")?;
                let stride = self.decorations.get(&(id, ARRAY_STRIDE)).ok_or("array without stride")?;
                stride * length
            }
            Type::Struct(members) => {
                let last = members.len() as u32 - 1;
                let matrix = self.member_decorations.contains_key(&(id, last, MATRIX_STRIDE));
                let size = self.size(members[last as usize])?;
                self.offset(id, last) + if matrix { size.next_multiple_of(16) } else { size }
            }
            other => return Err(format!("type {other:?} has no size")),
        })
    }
}

/// A SPIR-V literal string: UTF-8, little-endian words, ended by a zero byte.
fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).take_while(|byte| *byte != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}
