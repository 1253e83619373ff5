//! The building blocks of every mode: lists that many threads append to, arguments that the device writes for itself,
//! compaction, tables, 16-bit floats, timestamps.
//!
//! A test breaks each of them on purpose ([`Sabotage`]): `Lost` leaves one thing out, `Unordered` makes an atomic operation
//! a read and a write, `Reversed` turns a direction or a comparison round, `Expected` changes what is expected.

mod half;
mod indirect;
mod lists;
mod order;
mod table;
mod timestamps;

use super::{Check, Lab, Sabotage, matches};
use crate::Result;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Program};
use bytemuck::Pod;

/// All rows of the group.
pub(super) fn add(list: &mut Vec<Check>) {
    let start = list.len();
    lists::add(list);
    indirect::add(list);
    order::add(list);
    table::add(list);
    half::add(list);
    timestamps::add(list);
    for check in &mut list[start..] {
        let seen = SEEN.iter().find(|(pattern, _)| matches(pattern, &check.id));
        check.fails_by.extend(seen.map_or(&[][..], |(_, by)| by));
    }
}

/// Which breakages a row must see; the first pattern that fits counts.
const SEEN: &[(&str, &[Sabotage])] = {
    use Sabotage::{Expected, Lost, Reversed, Unordered};
    &[
        ("blocks.*.full", &[Lost, Unordered, Reversed, Expected]), // reversed: written where there is no room
        ("blocks.append", &[Lost, Unordered, Expected]),
        ("blocks.linked-lists", &[Lost, Unordered, Expected]),
        ("blocks.indirect.dispatch", &[Lost, Reversed, Expected]),
        ("blocks.indirect.draw", &[Lost, Expected]),
        ("blocks.prefix-sum", &[Lost]),
        ("blocks.stable-sort", &[Lost, Reversed]), // reversed: equal keys change places
        ("blocks.compaction", &[Lost, Reversed]),
        ("blocks.filter.*", &[Lost, Reversed, Unordered, Expected]), // unordered: another way to repeat
        ("blocks.half.*", &[Lost, Reversed, Expected]),
        ("blocks.timestamps.order", &[Reversed, Expected]),
        ("blocks.timestamps.*", &[Lost, Reversed]),
    ]
};

/// A compute pipeline, broken if the lab is told to.
fn pipeline(lab: &Lab, program: &'static Program) -> Result<ComputePipeline> {
    let broken = match lab.sabotage() {
        Some(Sabotage::Lost) => 1,
        Some(Sabotage::Unordered) => 2,
        Some(Sabotage::Reversed) => 3,
        _ => 0,
    };
    ComputePipeline::new(lab.gpu(), program, &[("SABOTAGE", broken)])
}

/// `value`, or another one if a test wants what is expected to be wrong.
fn expected(lab: &Lab, value: u32) -> u32 {
    if lab.sabotage() == Some(Sabotage::Expected) { value ^ 1 } else { value }
}

/// The hash of `glsl/conform/blocks.glsl`.
use crate::reference::density::pcg as hash;

/// The first `count` elements of a device buffer.
fn read<T: Pod>(lab: &mut Lab, buffer: &Buffer, count: usize) -> Result<Vec<T>> {
    let bytes = (count * size_of::<T>()) as u64;
    let readback = Buffer::new(lab.gpu(), "conform readback", bytes, BufferKind::Readback)?;
    lab.frames().run(|rec| {
        rec.copy_buffer(buffer, &readback, bytes);
        rec.make_visible_to_host(&readback);
        Ok(())
    })?;
    Ok(readback.read(0, count))
}

/// A device buffer of words with `start` in it.
fn words(lab: &mut Lab, name: &str, start: &[u32]) -> Result<Buffer> {
    let upload = Buffer::upload(lab.gpu(), name, start)?;
    let buffer = Buffer::array::<u32>(lab.gpu(), name, start.len())?;
    lab.frames().run(|rec| {
        rec.copy_buffer(&upload, &buffer, size_of_val(start) as u64);
        Ok(())
    })?;
    Ok(buffer)
}
