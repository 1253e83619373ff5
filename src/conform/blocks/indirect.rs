//! Dispatches and draws whose sizes the device writes.

use super::{expected, pipeline, read, words};
use crate::Result;
use crate::conform::{Check, Group, Lab, Verdict};
use crate::gpu::{Draw, GraphicsPipeline, GraphicsState};
use crate::shaders::{
    conform_blocks_args_comp as args, conform_blocks_groups_comp as groups, conform_blocks_mark_frag as mark,
};

pub(super) fn add(list: &mut Vec<Check>) {
    list.push(
        Check::new(
            Group::Blocks,
            "indirect.dispatch",
            "a dispatch takes its size from a buffer that a dispatch before it has written: no group with a 0 in any \
             direction, else each group once, up to 65535 in x",
            dispatches,
        )
        .why("No stage knows on the host how many cells, particles or tiles it will find")
        .spec(
            "Vulkan 1.3, vkCmdDispatchIndirect; VK_ACCESS_2_INDIRECT_COMMAND_READ; maxComputeWorkGroupCount >= 65535",
        ),
    );
    list.push(
        Check::new(
            Group::Blocks,
            "indirect.draw",
            "a draw takes vertices and instances from a buffer that a dispatch before it has written: nothing with 0 of \
             either, else each instance once",
            draws,
        )
        .why("The particles in view are drawn so: one instance each, as many as the device has found")
        .spec("Vulkan 1.3, vkCmdDrawIndirect; VK_ACCESS_2_INDIRECT_COMMAND_READ"),
    );
}

fn dispatches(lab: &mut Lab) -> Result<Verdict> {
    let make = pipeline(lab, &args::PROGRAM)?;
    let run = pipeline(lab, &groups::PROGRAM)?;
    let mut sizes = vec![[0, 1, 1], [5, 0, 3], [9, 9, 0], [1, 1, 1], [7, 5, 3], [65_535, 1, 1]];
    if !lab.quick() {
        sizes.extend([[1, 65_535, 1], [1, 1, 65_535], [1000, 100, 3], [65_535, 3, 2]]);
    }
    for [x, y, z] in sizes {
        let many = (x * y * z) as usize;
        let source = words(lab, "args source", &[x, y, z, 77])?;
        let made = words(lab, "args", &[1; 4])?;
        let visits = words(lab, "group visits", &vec![0; many + 1])?;
        lab.frames().run(|rec| {
            rec.dispatch(&make, &args::Bindings { source: &source, made: &made }, &(), [1, 1, 1])?;
            rec.dispatch_indirect(&run, &groups::Bindings { visits: &visits }, &(), &made, 0)
        })?;
        let times = 4 * expected(lab, 1); // four threads to a group
        if let Some(fault) = fault(&read(lab, &visits, many + 1)?, times, "group") {
            return Ok(Verdict::fail(format!("each of {x}x{y}x{z} groups once"), fault));
        }
    }
    Ok(Verdict::Pass("sizes of 0, 1, odd ones, and 65535 in a direction".into()))
}

fn draws(lab: &mut Lab) -> Result<Verdict> {
    let make = pipeline(lab, &args::PROGRAM)?;
    let draw = GraphicsPipeline::new(lab.gpu(), &mark::PROGRAM, &[], GraphicsState::default())?;
    let size = if lab.quick() { [128u32, 64] } else { [512, 256] };
    let most = size[0] * size[1];
    for [vertices, instances] in [[4, 0], [0, 4], [4, 1], [4, 1000], [4, most]] {
        let source = words(lab, "args source", &[vertices, instances, 0, 0])?;
        let made = words(lab, "args", &[1; 4])?;
        let visits = words(lab, "instance visits", &vec![0; most as usize + 1])?;
        lab.frames().run(|rec| {
            rec.dispatch(&make, &args::Bindings { source: &source, made: &made }, &(), [1, 1, 1])?;
            let indirect = Draw::Indirect { args: &made, offset: 0 };
            rec.draw(&draw, &mark::Bindings { visits: &visits }, &size, size, &[], indirect)
        })?;
        let visits: Vec<u32> = read(lab, &visits, most as usize + 1)?;
        let drawn = if vertices == 0 { 0 } else { instances as usize };
        let times = expected(lab, 1);
        if let Some(fault) = fault(&visits[..=drawn], times, "instance") {
            return Ok(Verdict::fail(format!("each of {drawn} instances once"), fault));
        }
        if let Some(more) = visits[drawn + 1..].iter().position(|&count| count != 0) {
            return Ok(Verdict::fail(format!("{drawn} instances"), format!("instance {} too", drawn + more)));
        }
    }
    Ok(Verdict::Pass(format!("0 to {most} instances of a quad over their own pixel")))
}

/// What is wrong with the visits of places; word 0 counts visits of places that are none.
fn fault(visits: &[u32], times: u32, what: &str) -> Option<String> {
    if visits[0] != 0 {
        return Some(format!("{} visits of a {what} that there is not", visits[0]));
    }
    let odd = visits[1..].iter().position(|&count| count != times)?;
    Some(format!("{what} {odd} left {} marks instead of {times}", visits[odd + 1]))
}
