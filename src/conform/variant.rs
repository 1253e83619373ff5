//! Programs that differ from compiled ones in an execution mode alone.

use super::{Interlock, Lab, Sabotage, Spirv, Verdict};
use crate::gpu::{BindingSet, Program, Resource, ShaderStage, Stage};
use std::sync::{Mutex, PoisonError};

/// How a program's fragment stage is changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Change {
    /// Another interlock mode, and whether the depth test comes before the shader.
    Interlock(Interlock, bool),
    /// No interlock at all.
    None,
}

/// Programs made so far: they live as long as the process, one for each change of each program.
static MADE: Mutex<Vec<(&'static Program, Change, &'static Program)>> = Mutex::new(Vec::new());

/// `program` with `change`.
pub(super) fn variant(program: &'static Program, change: Change) -> &'static Program {
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((.., variant)) = made.iter().find(|(of, c, _)| std::ptr::eq(*of, program) && *c == change) {
        return variant;
    }
    let stages = program.stages.iter().map(|stage| {
        let spirv: &'static [u8] = match (stage.kind, Spirv::of(program, stage.kind)) {
            (ShaderStage::Fragment, Some(module)) => {
                let module = match change {
                    Change::Interlock(interlock, early) => {
                        let module = module.with_interlock(interlock);
                        if early { module.with_early_tests() } else { module }
                    }
                    Change::None => module.without_interlock(),
                };
                let bytes: Vec<u8> = module.words().iter().flat_map(|word| word.to_le_bytes()).collect();
                Box::leak(bytes.into_boxed_slice())
            }
            _ => stage.spirv,
        };
        Stage { kind: stage.kind, spirv }
    });
    let stages: Vec<Stage> = stages.collect();
    let variant: &'static Program = Box::leak(Box::new(Program {
        stages: Box::leak(stages.into_boxed_slice()),
        interlock: change != Change::None,
        ..*program
    }));
    made.push((program, change, variant));
    variant
}

/// The program to run for `interlock`, as the lab's sabotage leaves it, once its SPIR-V has been looked at.
pub(super) fn interlocked(
    lab: &Lab,
    program: &'static Program,
    interlock: Interlock,
    early: bool,
) -> Result<&'static Program, Verdict> {
    let removed = matches!(lab.sabotage(), Some(Sabotage::Unordered | Sabotage::UnorderedUnseen));
    let change = if removed { Change::None } else { Change::Interlock(interlock, early) };
    let program = variant(program, change);
    if lab.sabotage() == Some(Sabotage::UnorderedUnseen) {
        return Ok(program);
    }
    let fault = match Spirv::of(program, ShaderStage::Fragment) {
        Some(module) => module.check_interlock(interlock, true).err(),
        None => Some("no fragment shader".to_owned()),
    };
    match fault {
        None => Ok(program),
        Some(fault) => Err(Verdict::fail(format!("SPIR-V that asks for {} interlock", interlock.name()), fault)),
    }
}

/// Bindings of a program, for a variant of it.
pub(super) struct Bound<'a> {
    pub program: &'static Program,
    pub bindings: &'a dyn BindingSet,
}

impl BindingSet for Bound<'_> {
    fn program(&self) -> &'static Program {
        self.program
    }

    fn resources(&self) -> Vec<Resource<'_>> {
        self.bindings.resources()
    }
}
