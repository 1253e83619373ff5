//! Looks into a SPIR-V module: whether ordering is asked for, and properly. Also rewrites modules, to make variants that
//! differ in nothing but an execution mode, and to break them on purpose.
//! Numbers are opcodes and enumerants of the SPIR-V 1.6 specification.

use crate::gpu::{Program, ShaderStage};
use std::collections::HashSet;

const OP_EXTENSION: u32 = 10;
const OP_ENTRY_POINT: u32 = 15;
const OP_EXECUTION_MODE: u32 = 16;
const OP_CAPABILITY: u32 = 17;
const OP_TYPE_POINTER: u32 = 32;
const OP_FUNCTION: u32 = 54;
const OP_VARIABLE: u32 = 59;
const OP_IMAGE_TEXEL_POINTER: u32 = 60;
const OP_LOAD: u32 = 61;
const OP_ACCESS_CHAIN: u32 = 65;
const OP_DECORATE: u32 = 71;
const OP_MEMBER_DECORATE: u32 = 72;
const OP_LOOP_MERGE: u32 = 246;
const OP_SELECTION_MERGE: u32 = 247;
const OP_LABEL: u32 = 248;
const OP_KILL: u32 = 252;
const OP_RETURN: u32 = 253;
const OP_TERMINATE: u32 = 4416;
const OP_BEGIN: u32 = 5364;
const OP_END: u32 = 5365;
const CAPABILITY_SAMPLE_INTERLOCK: u32 = 5363;
const CAPABILITY_PIXEL_INTERLOCK: u32 = 5378;
const DECORATION_COHERENT: u32 = 23;

/// Which fragments may not be in the critical section together, and whether they enter it in rasterization order.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Interlock {
    /// Fragments of one pixel, in order.
    PixelOrdered,
    /// Fragments of one pixel.
    PixelUnordered,
    /// Fragments of one sample, in order.
    SampleOrdered,
    /// Fragments of one sample.
    SampleUnordered,
}

impl Interlock {
    /// Every mode.
    pub const ALL: [Self; 4] = [Self::PixelOrdered, Self::PixelUnordered, Self::SampleOrdered, Self::SampleUnordered];

    /// The enumerant of the execution mode.
    fn mode(self) -> u32 {
        match self {
            Self::PixelOrdered => 5366,
            Self::PixelUnordered => 5367,
            Self::SampleOrdered => 5368,
            Self::SampleUnordered => 5369,
        }
    }

    /// Whether order is asked for.
    #[must_use]
    pub fn ordered(self) -> bool {
        matches!(self, Self::PixelOrdered | Self::SampleOrdered)
    }

    /// Whether it goes by samples.
    #[must_use]
    pub fn sample(self) -> bool {
        matches!(self, Self::SampleOrdered | Self::SampleUnordered)
    }

    /// As GLSL writes it, with dashes.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::PixelOrdered => "pixel-ordered",
            Self::PixelUnordered => "pixel-unordered",
            Self::SampleOrdered => "sample-ordered",
            Self::SampleUnordered => "sample-unordered",
        }
    }
}

/// An instruction.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Instruction {
    /// Its opcode.
    pub op: u32,
    /// The words after the first.
    pub operands: Vec<u32>,
}

/// A module as a list of instructions.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Spirv {
    header: [u32; 5],
    /// The instructions, in order.
    pub code: Vec<Instruction>,
}

/// The critical section of an entry point.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Section {
    /// Variables of storage images and buffers that it touches, by id.
    pub touched: HashSet<u32>,
}

impl Spirv {
    /// Takes a module apart; one that ends in the middle of an instruction loses that one.
    #[must_use]
    pub fn new(words: &[u32]) -> Self {
        let mut header = [0; 5];
        let (head, mut rest) = words.split_at(words.len().min(5));
        header[..head.len()].copy_from_slice(head);
        let mut code = Vec::new();
        while let Some(first) = rest.first() {
            let length = ((first >> 16) as usize).max(1);
            let Some(operands) = rest.get(1..length) else { break };
            code.push(Instruction { op: first & 0xffff, operands: operands.to_vec() });
            rest = &rest[length..];
        }
        Self { header, code }
    }

    /// The module of a program's `stage`; none if it has no such stage.
    #[must_use]
    pub fn of(program: &Program, stage: ShaderStage) -> Option<Self> {
        let stage = program.stages.iter().find(|s| s.kind == stage)?;
        let words = stage.spirv.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]));
        Some(Self::new(&words.collect::<Vec<_>>()))
    }

    /// The module as words.
    #[must_use]
    pub fn words(&self) -> Vec<u32> {
        let mut words = self.header.to_vec();
        for Instruction { op, operands } in &self.code {
            words.push((operands.len() as u32 + 1) << 16 | op);
            words.extend(operands);
        }
        words
    }

    /// The module with another interlock mode, and with the capability that it needs.
    #[must_use]
    pub fn with_interlock(mut self, interlock: Interlock) -> Self {
        let modes = Interlock::ALL.map(Interlock::mode);
        for Instruction { op, operands } in &mut self.code {
            match *op {
                OP_EXECUTION_MODE if modes.contains(&operands[1]) => operands[1] = interlock.mode(),
                OP_CAPABILITY if [CAPABILITY_PIXEL_INTERLOCK, CAPABILITY_SAMPLE_INTERLOCK].contains(&operands[0]) => {
                    operands[0] =
                        if interlock.sample() { CAPABILITY_SAMPLE_INTERLOCK } else { CAPABILITY_PIXEL_INTERLOCK };
                }
                _ => {}
            }
        }
        self
    }

    /// The module with the depth test before the shader (`early_fragment_tests`).
    #[must_use]
    pub fn with_early_tests(mut self) -> Self {
        const EARLY_FRAGMENT_TESTS: u32 = 9;
        if let Some(at) = self.code.iter().position(|i| i.op == OP_EXECUTION_MODE) {
            let operands = vec![self.code[at].operands[0], EARLY_FRAGMENT_TESTS];
            self.code.insert(at, Instruction { op: OP_EXECUTION_MODE, operands });
        }
        self
    }

    /// The module without any interlock: nothing orders its accesses, nothing keeps them apart.
    #[must_use]
    pub fn without_interlock(mut self) -> Self {
        let modes = Interlock::ALL.map(Interlock::mode);
        self.code.retain(|Instruction { op, operands }| match *op {
            OP_BEGIN | OP_END => false,
            OP_EXECUTION_MODE => !modes.contains(&operands[1]),
            OP_CAPABILITY => ![CAPABILITY_PIXEL_INTERLOCK, CAPABILITY_SAMPLE_INTERLOCK].contains(&operands[0]),
            OP_EXTENSION => !text(operands).contains("fragment_shader_interlock"),
            _ => true,
        });
        self
    }

    /// Checks that the entry point asks for `interlock`: its execution mode, one begin and one end, both outside every
    /// branch and loop. Nothing may leave the shader before the end, except by `discard` where `may_discard`.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn critical_section(&self, interlock: Interlock, may_discard: bool) -> Result<Section, String> {
        let entry = self.code.iter().find(|i| i.op == OP_ENTRY_POINT).ok_or("no entry point")?.operands[1];
        let asks = |i: &Instruction| i.op == OP_EXECUTION_MODE && i.operands[..2] == [entry, interlock.mode()];
        if !self.code.iter().any(asks) {
            return Err(format!("the execution mode is not {}", interlock.name()));
        }
        for (op, name) in [(OP_BEGIN, "begin"), (OP_END, "end")] {
            let times = self.code.iter().filter(|i| i.op == op).count();
            if times != 1 {
                return Err(format!("{times} times {name}"));
            }
        }
        let (mut function, mut merges, mut begin) = (0, Vec::new(), None);
        for (at, Instruction { op, operands }) in self.code.iter().enumerate() {
            match *op {
                OP_FUNCTION => (function, merges) = (operands[1], Vec::new()),
                OP_LOOP_MERGE | OP_SELECTION_MERGE => merges.push(operands[0]),
                OP_LABEL if merges.last() == Some(&operands[0]) => drop(merges.pop()),
                OP_BEGIN | OP_END if function != entry => return Err("outside the entry point".into()),
                OP_BEGIN | OP_END if !merges.is_empty() => return Err("inside a branch or loop".into()),
                OP_BEGIN => begin = Some(at),
                OP_END => {
                    let begin = begin.ok_or("end before begin")?;
                    return Ok(Section { touched: self.touched(&self.code[begin..at]) });
                }
                OP_KILL | OP_TERMINATE if function == entry && may_discard => {}
                OP_RETURN | OP_KILL | OP_TERMINATE if function == entry => {
                    return Err("the shader may leave early".into());
                }
                _ => {}
            }
        }
        Err("no end in the entry point".into())
    }

    /// Variables of storage images or buffers that `section` touches.
    fn touched(&self, section: &[Instruction]) -> HashSet<u32> {
        // Storage class of a pointer type: uniform constant (images) 0, storage buffer 12.
        let storage = |i: &&Instruction| i.op == OP_TYPE_POINTER && [0, 12].contains(&i.operands[1]);
        let pointers: HashSet<u32> = self.code.iter().filter(storage).map(|i| i.operands[0]).collect();
        let variable = |i: &&Instruction| i.op == OP_VARIABLE && pointers.contains(&i.operands[0]);
        let variables: HashSet<u32> = self.code.iter().filter(variable).map(|i| i.operands[1]).collect();
        let bases = section.iter().filter(|i| [OP_LOAD, OP_ACCESS_CHAIN, OP_IMAGE_TEXEL_POINTER].contains(&i.op));
        bases.map(|i| i.operands[2]).filter(|id| variables.contains(id)).collect()
    }

    /// Checks that everything in `touched` is `coherent`: interlock orders accesses, it does not make them visible.
    ///
    /// # Errors
    /// What is not, by its id.
    pub fn coherent(&self, touched: &HashSet<u32>) -> Result<(), String> {
        let decorated = |i: &&Instruction| i.op == OP_DECORATE && i.operands[1] == DECORATION_COHERENT;
        let coherent: HashSet<u32> = self.code.iter().filter(decorated).map(|i| i.operands[0]).collect();
        let members = |i: &&Instruction| i.op == OP_MEMBER_DECORATE && i.operands[2] == DECORATION_COHERENT;
        let blocks: HashSet<u32> = self.code.iter().filter(members).map(|i| i.operands[0]).collect();
        let block_of = |variable: u32| {
            let v = self.code.iter().find(|i| i.op == OP_VARIABLE && i.operands[1] == variable)?;
            self.code.iter().find(|i| i.op == OP_TYPE_POINTER && i.operands[0] == v.operands[0]).map(|p| p.operands[2])
        };
        match touched
            .iter()
            .find(|id| !coherent.contains(id) && !block_of(**id).is_some_and(|block| blocks.contains(&block)))
        {
            Some(id) => Err(format!("variable %{id} is touched in the critical section and is not coherent")),
            None => Ok(()),
        }
    }

    /// Everything that is asked of a shader of an ordering mode, in one.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check_interlock(&self, interlock: Interlock, may_discard: bool) -> Result<(), String> {
        let section = self.critical_section(interlock, may_discard)?;
        if section.touched.is_empty() {
            return Err("nothing is touched between begin and end".into());
        }
        self.coherent(&section.touched)
    }
}

/// A literal string: UTF-8 in little-endian words, ended by a zero byte.
fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).take_while(|byte| *byte != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shaders::blend_interlock_frag::TABLES as PROGRAM;

    fn good() -> Spirv {
        Spirv::of(&PROGRAM, ShaderStage::Fragment).unwrap()
    }

    fn without(op: u32) -> Spirv {
        let mut module = good();
        module.code.retain(|i| i.op != op);
        module
    }

    #[test]
    fn a_module_is_put_together_as_it_was() {
        let stage = PROGRAM.stages.iter().find(|s| s.kind == ShaderStage::Fragment).unwrap();
        let bytes: Vec<u8> = good().words().iter().flat_map(|word| word.to_le_bytes()).collect();
        assert!(bytes == stage.spirv);
        assert_eq!(Spirv::new(&[]).code, []);
        assert_eq!(Spirv::new(&[0; 5]).code, []);
    }

    #[test]
    fn a_missing_or_misplaced_interlock_is_seen() {
        let fault = |module: &Spirv| module.check_interlock(Interlock::PixelOrdered, false).unwrap_err();
        good().check_interlock(Interlock::PixelOrdered, false).unwrap();
        assert!(fault(&without(OP_BEGIN)).contains("0 times begin"));
        assert!(fault(&without(OP_END)).contains("0 times end"));
        assert!(fault(&without(OP_EXECUTION_MODE)).contains("execution mode"));
        assert!(fault(&good().without_interlock()).contains("execution mode"));
        assert!(fault(&good().with_interlock(Interlock::PixelUnordered)).contains("execution mode"));
        assert!(fault(&without(OP_DECORATE)).contains("not coherent"));
        // Behind the first branch of the shader, before the branches meet again.
        let entry = good().code.iter().find(|i| i.op == OP_ENTRY_POINT).unwrap().operands[1];
        let mut branch = without(OP_BEGIN);
        let main = branch.code.iter().position(|i| i.op == OP_FUNCTION && i.operands[1] == entry).unwrap();
        let at = main + branch.code[main..].iter().position(|i| i.op == OP_SELECTION_MERGE).unwrap();
        branch.code.insert(at + 3, Instruction { op: OP_BEGIN, operands: Vec::new() }); // merge, conditional branch, label
        assert!(fault(&branch).contains("inside a branch"));
        // A discard before the end, where none may be.
        let mut leaving = good();
        let at = leaving.code.iter().position(|i| i.op == OP_END).unwrap();
        leaving.code.insert(at, Instruction { op: OP_TERMINATE, operands: Vec::new() });
        assert!(fault(&leaving).contains("leave early"));
        leaving.check_interlock(Interlock::PixelOrdered, true).unwrap();
    }

    #[test]
    fn every_mode_can_be_asked_for_and_is_recognised() {
        for interlock in Interlock::ALL {
            let module = good().with_interlock(interlock);
            for other in Interlock::ALL {
                assert_eq!(module.check_interlock(other, false).is_ok(), interlock == other, "{interlock:?} {other:?}");
            }
        }
    }
}
