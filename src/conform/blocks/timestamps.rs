//! Timestamps: the times of passes are made of them.

use super::{pipeline, read};
use crate::Result;
use crate::conform::{Check, Group, Lab, Need, Sabotage, Verdict};
use crate::gpu::{Attachment, BlendState, Buffer, Draw, GraphicsPipeline, GraphicsState, Image, ImageDesc, Target};
use crate::shaders::{conform_blocks_work_comp as work, conform_blocks_work_frag as shade};
use ash::vk;

const SPEC: &str = "Vulkan 1.3, vkCmdWriteTimestamp2: written when all previous commands have completed the stage; \
                    VkQueueFamilyProperties::timestampValidBits is 0 or 36 to 64";
const WHY: &str = "`bench` and `render --stats` tell the times of passes by them";
/// Timestamps in a command buffer.
const MARKS: u32 = 16;

pub(super) fn add(list: &mut Vec<Check>) {
    let needs = [Need::Timestamps];
    list.push(
        Check::new(
            Group::Blocks,
            "timestamps.order",
            "timestamps of one command buffer and of the next never run backwards, and keep within their valid bits",
            order,
        )
        .why(WHY)
        .spec(SPEC)
        .needs(needs),
    );
    for (name, what, kind) in [
        (
            "timestamps.draw",
            "a draw with 16 times the work of another takes longer, and neither takes no time",
            Work::Draw,
        ),
        (
            "timestamps.dispatch",
            "a dispatch with 16 times the work of another takes longer, and neither takes no time",
            Work::Dispatch,
        ),
    ] {
        list.push(
            Check::new(Group::Blocks, name, what, move |lab| takes_time(lab, kind)).why(WHY).spec(SPEC).needs(needs),
        );
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Work {
    Draw,
    Dispatch,
}

fn order(lab: &mut Lab) -> Result<Verdict> {
    let bits = lab.gpu().capabilities().timestamp_valid_bits;
    if !(36..=64).contains(&bits) {
        return Ok(Verdict::fail("36 to 64 valid bits", bits.to_string()));
    }
    let mut last = 0;
    let submissions = if lab.quick() { 3 } else { 50 };
    let pool = Pool::new(lab)?;
    for submission in 0..submissions {
        let mut ticks = pool.marks(lab)?;
        match lab.sabotage() {
            Some(Sabotage::Reversed) => ticks.reverse(),
            Some(Sabotage::Expected) => ticks[0] = u64::MAX,
            _ => {}
        }
        for tick in ticks {
            if bits < 64 && tick >> bits != 0 {
                return Ok(Verdict::fail(format!("at most {bits} bits"), format!("{tick:#x}")));
            }
            // A counter that wraps around within a second of test would be met once in years.
            if tick < last {
                return Ok(Verdict::fail(format!("at least {last}"), format!("{tick} in submission {submission}")));
            }
            last = tick;
        }
    }
    Ok(Verdict::Pass(format!("{} in {submissions} submissions, {bits} bits", submissions * MARKS)))
}

/// A pool of timestamp queries.
struct Pool {
    device: ash::Device,
    pool: vk::QueryPool,
}

impl Pool {
    fn new(lab: &Lab) -> Result<Self> {
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(MARKS);
        let gpu = lab.gpu();
        // SAFETY: the device is alive as long as the lab, here and below.
        let pool = unsafe { gpu.device().create_query_pool(&info, None) }
            .map_err(|result| gpu.error("vkCreateQueryPool", "conform timestamps", result))?;
        Ok(Self { device: gpu.device().clone(), pool })
    }

    /// Timestamps at all of the stages that commands go through, with a little work between them.
    fn marks(&self, lab: &mut Lab) -> Result<Vec<u64>> {
        let gpu = lab.gpu().clone();
        let buffer = Buffer::array::<u32>(&gpu, "conform work", 1024)?;
        lab.frames().run(|rec| {
            let cmd = rec.command_buffer();
            // SAFETY: the command buffer is recording, outside a render pass; the pool's last use has ended.
            unsafe { self.device.cmd_reset_query_pool(cmd, self.pool, 0, MARKS) };
            for query in 0..MARKS {
                rec.fill_buffer(&buffer, 0, 4096, query);
                // SAFETY: as above; each query is written once after its reset.
                unsafe {
                    let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
                    self.device.cmd_write_timestamp2(cmd, stage, self.pool, query);
                }
            }
            Ok(())
        })?;
        let mut ticks = vec![0u64; MARKS as usize];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: as many queries as elements are read; all were written by a submission that has ended.
        unsafe { self.device.get_query_pool_results(self.pool, 0, &mut ticks, flags) }
            .map_err(|result| gpu.error("vkGetQueryPoolResults", "conform timestamps", result))?;
        lab.frames().state().forget();
        Ok(ticks)
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        // SAFETY: every submission that used it has ended.
        unsafe { self.device.destroy_query_pool(self.pool, None) };
    }
}

fn takes_time(lab: &mut Lab, kind: Work) -> Result<Verdict> {
    let gpu = lab.gpu().clone();
    let side = if lab.quick() { 64u32 } else { 256 };
    let format = vk::Format::R8G8B8A8_UNORM;
    let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT;
    let target = Image::new(&gpu, &ImageDesc { name: "conform work", extent: [side, side, 0], format, usage })?;
    let state = GraphicsState {
        topology: vk::PrimitiveTopology::TRIANGLE_LIST,
        attachments: vec![Attachment { format, blend: BlendState::Replace }],
        ..GraphicsState::default()
    };
    let draw = GraphicsPipeline::new(&gpu, &shade::PROGRAM, &[], state)?;
    let dispatch = pipeline(lab, &work::PROGRAM)?;
    let result = Buffer::array::<u32>(&gpu, "conform work", (side * side) as usize)?;
    let reversed = lab.sabotage() == Some(Sabotage::Reversed);
    let rounds = |which: usize| if (which == 1) != reversed { 8000u32 } else { 500 };
    let nothing = lab.sabotage() == Some(Sabotage::Lost);
    // The first two runs compile and touch memory; the least of the others is what the work takes. Each comes first in
    // every other run, so that neither always has what the first pass of a submission costs.
    let mut best = [f64::INFINITY; 2];
    for run in 0..10 {
        let order = if run % 2 == 0 { [0, 1] } else { [1, 0] };
        let (slot, ()) = lab.frames().submit(|rec| {
            for which in order {
                rec.pass(["little work", "much work"][which], |rec| match kind {
                    _ if nothing => Ok(()),
                    Work::Draw => {
                        let targets = [Target { image: &target, clear: Some([0.0; 4]) }];
                        let all = Draw::Direct { vertices: 3, instances: 1 };
                        rec.draw(&draw, &shade::Bindings {}, &rounds(which), [side; 2], &targets, all)
                    }
                    Work::Dispatch => {
                        let bindings = work::Bindings { result: &result };
                        rec.dispatch(&dispatch, &bindings, &rounds(which), [side * side, 1, 1])
                    }
                })?;
            }
            Ok(())
        })?;
        lab.frames().wait()?;
        let times = lab.frames().state().times(slot);
        for (which, time) in order.into_iter().zip(times).filter(|_| run > 1) {
            best[which] = best[which].min(time.gpu_ms);
        }
    }
    // The work was done, whatever the times say.
    if kind == Work::Dispatch && !nothing && read::<u32>(lab, &result, 64)?.iter().all(|&v| v == 0) {
        return Ok(Verdict::fail("the results of the work", "zeros"));
    }
    let [little, much] = best;
    let found = format!("{little:.4} ms and {much:.4} ms");
    // 16 times the work: at least three times the time, so that launching it may cost as much as some of it.
    if little > 0.0 && much > 3.0 * little {
        return Ok(Verdict::Pass(format!("{found} for 16 times the work")));
    }
    Ok(Verdict::fail("more than three times the time for 16 times the work", found))
}
