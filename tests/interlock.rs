//! That ordering is really asked for. A software rasterizer runs a pixel's fragments in order even where nobody asked, so
//! no picture made on one can show a missing interlock: the SPIR-V itself is looked at.

use std::collections::HashSet;
use welkin::gpu::{Program, ShaderStage};
use welkin::shaders::{blend_interlock_frag, tiling_insert_frag};

// Numbers of the SPIR-V specification.
const OP_EXECUTION_MODE: u32 = 16;
const OP_FUNCTION: u32 = 54;
const OP_VARIABLE: u32 = 59;
const OP_LOAD: u32 = 61;
const OP_IMAGE_TEXEL_POINTER: u32 = 60;
const OP_ACCESS_CHAIN: u32 = 65;
const OP_DECORATE: u32 = 71;
const OP_MEMBER_DECORATE: u32 = 72;
const OP_TYPE_POINTER: u32 = 32;
const OP_IMAGE_READ: u32 = 98;
const OP_IMAGE_WRITE: u32 = 99;
const OP_LOOP_MERGE: u32 = 246;
const OP_SELECTION_MERGE: u32 = 247;
const OP_LABEL: u32 = 248;
const OP_KILL: u32 = 252;
const OP_RETURN: u32 = 253;
const OP_ENTRY_POINT: u32 = 15;
const OP_TERMINATE: u32 = 4416;
const OP_BEGIN: u32 = 5364;
const OP_END: u32 = 5365;
const MODE_PIXEL_INTERLOCK_ORDERED: u32 = 5366;
const DECORATION_COHERENT: u32 = 23;

/// Opcode and operands of each instruction.
fn instructions(program: &Program) -> Vec<(u32, Vec<u32>)> {
    let stage = program.stages.iter().find(|stage| stage.kind == ShaderStage::Fragment).unwrap();
    let words: Vec<u32> =
        stage.spirv.chunks_exact(4).map(|bytes| u32::from_le_bytes(bytes.try_into().unwrap())).collect();
    let mut at = 5; // the header
    let mut all = Vec::new();
    while at < words.len() {
        let length = (words[at] >> 16) as usize;
        all.push((words[at] & 0xffff, words[at + 1..at + length].to_vec()));
        at += length;
    }
    all
}

/// The critical section of the entry point: one begin and one end, both outside every branch and loop, nothing leaving the
/// shader before the end. Returns the instructions between them.
fn critical_section(all: &[(u32, Vec<u32>)]) -> Result<Vec<(u32, Vec<u32>)>, String> {
    let entry = all.iter().find(|(op, _)| *op == OP_ENTRY_POINT).ok_or("no entry point")?.1[1];
    let ordered = |(op, operands): &(u32, Vec<u32>)| {
        *op == OP_EXECUTION_MODE && operands[0] == entry && operands[1] == MODE_PIXEL_INTERLOCK_ORDERED
    };
    if !all.iter().any(ordered) {
        return Err("the execution mode does not ask for ordered pixel interlock".into());
    }
    for (op, name) in [(OP_BEGIN, "begin"), (OP_END, "end")] {
        let count = all.iter().filter(|(other, _)| *other == op).count();
        if count != 1 {
            return Err(format!("{count} times {name}"));
        }
    }
    let mut function = 0;
    let mut merges = Vec::new();
    let mut section = None;
    for (op, operands) in all {
        match *op {
            OP_FUNCTION => (function, merges) = (operands[1], Vec::new()),
            OP_LOOP_MERGE | OP_SELECTION_MERGE => merges.push(operands[0]),
            OP_LABEL if merges.last() == Some(&operands[0]) => drop(merges.pop()),
            OP_BEGIN | OP_END if function != entry => return Err("outside the entry point".into()),
            OP_BEGIN | OP_END if !merges.is_empty() => return Err("inside a branch or loop".into()),
            OP_BEGIN => section = Some(Vec::new()),
            OP_END => return section.ok_or("end before begin".into()),
            OP_RETURN | OP_KILL | OP_TERMINATE if function == entry => return Err("the shader may leave early".into()),
            _ => {}
        }
        if let Some(section) = &mut section
            && *op != OP_BEGIN
        {
            section.push((*op, operands.clone()));
        }
    }
    Err("no end in the entry point".into())
}

/// Variables of storage images or buffers that `section` touches.
fn touched(all: &[(u32, Vec<u32>)], section: &[(u32, Vec<u32>)]) -> HashSet<u32> {
    // Storage class of a pointer type: uniform constant (images) 0, storage buffer 12.
    let pointers: HashSet<u32> =
        all.iter().filter(|(op, o)| *op == OP_TYPE_POINTER && [0, 12].contains(&o[1])).map(|(_, o)| o[0]).collect();
    let variables: HashSet<u32> =
        all.iter().filter(|(op, o)| *op == OP_VARIABLE && pointers.contains(&o[0])).map(|(_, o)| o[1]).collect();
    let bases = section.iter().filter(|(op, _)| [OP_LOAD, OP_ACCESS_CHAIN, OP_IMAGE_TEXEL_POINTER].contains(op));
    bases.map(|(_, o)| o[2]).filter(|id| variables.contains(id)).collect()
}

#[test]
fn every_ordered_program_asks_for_order_once_at_the_top_level() {
    for program in [&blend_interlock_frag::PROGRAM, &tiling_insert_frag::PROGRAM] {
        let all = instructions(program);
        let section = critical_section(&all).unwrap_or_else(|fault| panic!("{}: {fault}", program.name));
        let accesses = section.iter().filter(|(op, _)| [OP_LOAD, OP_IMAGE_READ, OP_IMAGE_WRITE].contains(op)).count();
        assert!(accesses > 0, "{}: nothing is touched between begin and end", program.name);
        assert!(program.interlock, "{}: the reflection knows", program.name);
    }
}

#[test]
fn what_is_ordered_is_also_coherent() {
    // Interlock orders accesses, it does not make them visible.
    for program in [&blend_interlock_frag::PROGRAM, &tiling_insert_frag::PROGRAM] {
        let all = instructions(program);
        let coherent: HashSet<u32> =
            all.iter().filter(|(op, o)| *op == OP_DECORATE && o[1] == DECORATION_COHERENT).map(|(_, o)| o[0]).collect();
        let members = all.iter().any(|(op, o)| *op == OP_MEMBER_DECORATE && o[2] == DECORATION_COHERENT);
        let section = critical_section(&all).unwrap();
        let touched = touched(&all, &section);
        assert!(!touched.is_empty(), "{}", program.name);
        for id in touched {
            assert!(coherent.contains(&id) || members, "{}: variable %{id} is not coherent", program.name);
        }
    }
}

#[test]
fn a_missing_or_misplaced_interlock_is_seen() {
    let good = instructions(&blend_interlock_frag::PROGRAM);
    let without = |op: u32| good.iter().filter(|(other, _)| *other != op).cloned().collect::<Vec<_>>();
    assert!(critical_section(&good).is_ok());
    assert!(critical_section(&without(OP_BEGIN)).unwrap_err().contains("0 times begin"));
    assert!(critical_section(&without(OP_END)).unwrap_err().contains("0 times end"));
    assert!(critical_section(&without(OP_EXECUTION_MODE)).unwrap_err().contains("execution mode"));
    // Behind the first branch of the shader, before the branches meet again.
    let entry = good.iter().find(|(op, _)| *op == OP_ENTRY_POINT).unwrap().1[1];
    let main = good.iter().position(|(op, o)| *op == OP_FUNCTION && o[1] == entry).unwrap();
    let mut branch = without(OP_BEGIN);
    let at = main + branch[main..].iter().position(|(op, _)| *op == OP_SELECTION_MERGE).unwrap();
    branch.insert(at + 3, (OP_BEGIN, Vec::new())); // merge, conditional branch, label
    assert!(critical_section(&branch).unwrap_err().contains("inside a branch"));
}
