//! Rows that need no device: what Welkin's own shaders ask for, as compiled.

use super::{Check, Group, Interlock, Lab, Sabotage, Spirv, Verdict};
use crate::gpu::{Program, ShaderStage};

/// One row for each shader that uses interlock, whatever lighting methods it is compiled for.
pub(super) fn add(list: &mut Vec<Check>) {
    for programs in crate::shaders::PROGRAMS.chunk_by(|a, b| a.name == b.name) {
        let program = programs[0];
        if !program.interlock || program.name.starts_with("conform/") {
            continue;
        }
        let name = program.name.rsplit_once('.').map_or(program.name, |(stem, _)| stem).replace(['/', '_'], "-");
        let what = format!(
            "glsl/{} asks for ordered pixel interlock: execution mode, one begin and one end at the top level of its entry \
             point, no way out between them, everything touched between them coherent",
            program.name
        );
        list.push(
            Check::new(Group::Static, name, what, move |lab| Ok(check(lab, programs)))
                .why(
                    "A driver may do anything with a shader that asks wrongly; and a software driver keeps order unasked, \
                     so no picture of its shows what was asked for",
                )
                .spec("SPV_EXT_fragment_shader_interlock; VK_EXT_fragment_shader_interlock")
                .fails_by([Sabotage::Unordered]),
        );
    }
}

fn check(lab: &Lab, programs: &[&'static Program]) -> Verdict {
    for program in programs {
        let Some(mut module) = Spirv::of(program, ShaderStage::Fragment) else {
            return Verdict::fail("a fragment shader", "none");
        };
        if lab.sabotage() == Some(Sabotage::Unordered) {
            module = module.without_interlock();
        }
        if let Err(fault) = module.check_interlock(Interlock::PixelOrdered, false) {
            return Verdict::fail("ordered pixel interlock, asked for properly", fault);
        }
    }
    Verdict::Pass("asked for once, at the top level".into())
}
