//! Welkin's own prefix sum, sort and compaction against the same on the CPU.

use super::{hash, read, words};
use crate::Result;
use crate::compact::{Compact, Scan, Sort, frustum_planes};
use crate::conform::{Check, Group, Lab, Sabotage, Verdict};
use crate::gpu::Buffer;
use crate::grid::{Counters, ParticleList, ParticleSet};
use crate::params::ParticleDesc;
use crate::reference::compact::{draw_order, reach_into};
use crate::shared::{FrameParams, Particle};
use bytemuck::Zeroable;

const PORTABLE: &str = "Vulkan 1.3, Shaders: shared memory, barrier() within a work group; no subgroup size, no forward \
                        progress between work groups is assumed";

pub(super) fn add(list: &mut Vec<Check>) {
    list.push(
        Check::new(
            Group::Blocks,
            "prefix-sum",
            "the prefix sum of lists around the length of a block, and of many blocks, is that of the CPU, word for word",
            scan,
        )
        .why("It turns flags into places: compaction and the particles' slots rest on it")
        .spec(PORTABLE),
    );
    list.push(
        Check::new(
            Group::Blocks,
            "stable-sort",
            "sorting pairs by key with many equal keys gives the CPU's stable order, and the same again on every run",
            sort,
        )
        .why("Draw order must be a function of the particles alone, or pictures of still scenes flicker")
        .spec(PORTABLE),
    );
    list.push(
        Check::new(
            Group::Blocks,
            "compaction",
            "the particles in view, back to front, equal distances in the list's order: the CPU's list, index for index, \
             with the indirect arguments for it",
            compaction,
        )
        .why("It feeds every draw of particles")
        .spec(PORTABLE),
    );
}

fn lengths(lab: &Lab) -> &'static [u32] {
    if lab.quick() { &[1, 63, 1024, 1025, 5000] } else { &[1, 63, 64, 1023, 1024, 1025, 70_000, 1_100_000] }
}

fn scan(lab: &mut Lab) -> Result<Verdict> {
    let lengths = lengths(lab);
    let longest = lengths[lengths.len() - 1];
    let mut numbers: Vec<u32> = (0..longest).map(|i| hash(i) % 25).collect();
    let scan = Scan::new(lab.gpu(), longest)?;
    let values = words(lab, "values", &numbers)?;
    if lab.sabotage().is_some() {
        numbers[0] += 1; // The device is given another list than the CPU.
    }
    let scanned = Buffer::array::<u32>(lab.gpu(), "scanned", longest as usize)?;
    let total = Buffer::array::<u32>(lab.gpu(), "total", 1)?;
    for &length in lengths {
        lab.frames().run(|rec| scan.record(rec, &values, length, &scanned, &total))?;
        let mut sum = 0;
        let of_device: Vec<u32> = read(lab, &scanned, length as usize)?;
        for (index, number) in numbers[..length as usize].iter().enumerate() {
            if of_device[index] != sum {
                let found = format!("{} at {index} of {length}", of_device[index]);
                return Ok(Verdict::fail(format!("a sum of {sum}"), found));
            }
            sum += number;
        }
        let of_device = read::<u32>(lab, &total, 1)?[0];
        if of_device != sum {
            return Ok(Verdict::fail(format!("a total of {sum}"), format!("{of_device} of {length} numbers")));
        }
    }
    Ok(Verdict::Pass(format!("{} lengths up to {longest}", lengths.len())))
}

fn sort(lab: &mut Lab) -> Result<Verdict> {
    let lengths = &lengths(lab)[..lengths(lab).len().min(7)];
    let longest = lengths[lengths.len() - 1];
    // Few different high bits and many equal keys: ties must keep their order.
    let all: Vec<u32> = (0..longest).map(|i| if i % 3 == 0 { hash(i) } else { hash(i) % 100 }).collect();
    let sort = Sort::new(lab.gpu(), longest)?;
    for &length in lengths {
        let unsorted = &all[..length as usize];
        let mut order: Vec<u32> = (0..length).collect();
        order.sort_by_key(|&i| unsorted[i as usize]);
        if lab.sabotage() == Some(Sabotage::Reversed) {
            order.sort_by_key(|&i| (unsorted[i as usize], length - i)); // unstable: ties the other way round
        } else if lab.sabotage().is_some() {
            order.rotate_left(1);
        }
        for _ in 0..2 {
            let keys = words(lab, "keys", unsorted)?;
            let indices = words(lab, "indices", &(0..length).collect::<Vec<_>>())?;
            let count = words(lab, "count", &[length])?;
            let args = words(lab, "args", &[length.div_ceil(1024), 1, 1])?;
            lab.frames().run(|rec| sort.record(rec, (&count, 0), (&args, 0), &keys, &indices))?;
            let of_device: Vec<u32> = read(lab, &indices, length as usize)?;
            if let Some(index) = (0..length as usize).find(|&i| of_device[i] != order[i]) {
                let found = format!("{} at {index} of {length}", of_device[index]);
                return Ok(Verdict::fail(format!("index {}", order[index]), found));
            }
        }
    }
    Ok(Verdict::Pass(format!("{} lengths up to {longest}, each twice", lengths.len())))
}

fn compaction(lab: &mut Lab) -> Result<Verdict> {
    let count = if lab.quick() { 3000u32 } else { 100_000 };
    let frame = FrameParams {
        camera: [3.0, 5.0, 7.0],
        tan_half_fov_y: 0.5,
        aspect: 1.5,
        right: [1.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
        forward: [0.0, 0.0, -1.0],
        ..FrameParams::zeroed()
    };
    let planes = frustum_planes(&frame);
    let list = lattice(count, &planes);
    let mut particles = ParticleList::new(lab.gpu(), &list, 1)?;
    let set = ParticleSet::new(lab.gpu(), count)?;
    let compact = Compact::new(lab.gpu(), count)?;
    lab.frames().run(|rec| {
        particles.record(rec, [0.0; 3], &set)?;
        compact.record(rec, &set, &planes, frame.camera)
    })?;
    let of_device = read::<Counters>(lab, set.counters(), 1)?[0].visible;
    let args: Vec<u32> = read(lab, compact.args(), 12)?;
    let order: Vec<u32> = read(lab, compact.order(), count as usize)?;

    let mut model: Vec<Particle> = (0..count as usize).map(|i| particles.particle(i, [0.0; 3])).collect();
    match lab.sabotage() {
        Some(Sabotage::Reversed) => model.reverse(), // ties come in another order
        Some(_) => model[0].centre = [0.0, 0.0, -901.0],
        None => {}
    }
    let visible: Vec<bool> = model.iter().map(|p| reach_into(p, &planes) > 0.0).collect();
    let model = draw_order(&model, &visible, frame.camera);
    if of_device != model.len() as u32 {
        return Ok(Verdict::fail(format!("{} particles in view", model.len()), of_device.to_string()));
    }
    if let Some(index) = (0..model.len()).find(|&i| order[i] != model[i]) {
        let found = format!("{} at {index} of {}", order[index], model.len());
        return Ok(Verdict::fail(format!("particle {}", model[index]), found));
    }
    let draw = &args[Compact::DRAW_ARGS as usize / 4..][..4];
    if draw != [crate::compact::VERTICES_PER_PARTICLE, of_device, 0, 0] {
        return Ok(Verdict::fail(format!("a draw of {of_device} instances"), format!("{draw:?}")));
    }
    Ok(Verdict::Pass(format!("{of_device} of {count} particles, in order")))
}

/// Particles on a lattice around the eye, so that many are equally far. The device also draws what it is not sure of, with
/// 0.1 % and 0.05 m of slack: none is as near as that to a plane of view.
fn lattice(count: u32, planes: &[[f32; 4]; 5]) -> Vec<ParticleDesc> {
    let place = |i: u32| [0, 1, 2].map(|axis| f64::from(hash(3 * i + axis) % 41) * 50.0 - 1000.0);
    let clear = |particle: &ParticleDesc| {
        let twin = Particle {
            centre: particle.centre.map(|c| c as f32),
            semi_axes: particle.radii,
            rotation: particle.rotation,
            ..Particle::zeroed()
        };
        reach_into(&twin, planes).abs() > 0.2
    };
    let all = (0..).map(|i| ParticleDesc { centre: place(i), radii: [1.0; 3], ..ParticleDesc::default() });
    all.filter(clear).take(count as usize).collect()
}
