//! Append buffers and linked lists, with room and without.

use super::{expected, hash, pipeline, read, words};
use crate::Result;
use crate::conform::{Check, Group, Lab, Verdict};
use crate::shaders::{conform_blocks_append_comp as append, conform_blocks_link_comp as link};
use bytemuck::{Pod, Zeroable};

const ATOMICS: &str = "Vulkan 1.3, Memory Model: atomic operations on one location are totally ordered; \
                       SPIR-V OpAtomicIAdd, OpAtomicExchange";
/// Words behind a list that nothing may touch, and what stands in them.
const GUARD: u32 = 64;
const UNTOUCHED: u32 = 0xdead_beef;

pub(super) fn add(list: &mut Vec<Check>) {
    list.push(
        Check::new(
            Group::Blocks,
            "append",
            "threads of many work groups append to a list through an atomic counter: the count is exact, every id is there \
             once, nothing else is",
            |lab| appended(lab, false),
        )
        .why("Cells, particles, fragments and tiles are gathered in such lists in every frame")
        .spec(ATOMICS),
    );
    list.push(
        Check::new(
            Group::Blocks,
            "append.full",
            "the same with a list too small: the counter tells the true need, the list is full of different ids, and the \
             words behind it are untouched",
            |lab| appended(lab, true),
        )
        .why("A list that is too small is grown before the next frame: the need must be told, and nothing be overwritten")
        .spec(ATOMICS),
    );
    list.push(
        Check::new(
            Group::Blocks,
            "linked-lists",
            "threads take nodes from a pool and exchange them with the heads of their lists: walking all lists meets every \
             node once, in the list it belongs to",
            |lab| linked(lab, false),
        )
        .why("Light tiles and the blend mode `list` chain their nodes so")
        .spec(ATOMICS),
    );
    list.push(
        Check::new(
            Group::Blocks,
            "linked-lists.full",
            "the same with a pool too small: the counter tells the true need, the nodes of the pool are all in lists, and \
             the words behind it are untouched",
            |lab| linked(lab, true),
        )
        .why("A frame with more fragments than nodes must say so and lose no more than it must")
        .spec(ATOMICS),
    );
}

fn threads(lab: &Lab) -> u32 {
    if lab.quick() { 1 << 14 } else { 1 << 20 }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct AppendPush {
    count: u32,
    capacity: u32,
    guard: u32,
    lost: u32,
}

fn appended(lab: &mut Lab, full: bool) -> Result<Verdict> {
    let count = threads(lab);
    let picked: Vec<u32> = (0..count).filter(|&id| hash(id) & 3 == 0).collect();
    let needed = picked.len() as u32;
    let capacity = if full { needed / 3 } else { needed + 100 };
    let program = pipeline(lab, &append::PROGRAM)?;
    let counter = words(lab, "append counter", &[0])?;
    let ids = words(lab, "append list", &vec![UNTOUCHED; (capacity + GUARD) as usize])?;
    let push = AppendPush { count, capacity, guard: GUARD, lost: picked[picked.len() / 2] };
    let bindings = append::Bindings { counter: &counter, list: &ids };
    lab.frames().run(|rec| rec.dispatch(&program, &bindings, &push, [count, 1, 1]))?;

    let wanted = read::<u32>(lab, &counter, 1)?[0];
    let expected = expected(lab, needed);
    if wanted != expected {
        return Ok(Verdict::fail(format!("{expected} appended"), format!("a counter of {wanted}")));
    }
    let stored = needed.min(capacity);
    let ids: Vec<u32> = read(lab, &ids, (capacity + GUARD) as usize)?;
    let (mut inside, behind) = (ids[..stored as usize].to_vec(), &ids[stored as usize..]);
    inside.sort_unstable();
    if let Some(twice) = inside.windows(2).find(|pair| pair[0] == pair[1]) {
        return Ok(Verdict::fail("every id once", format!("id {} twice", twice[0])));
    }
    if let Some(odd) = inside.iter().find(|&&id| picked.binary_search(&id).is_err()) {
        return Ok(Verdict::fail("ids that threads appended", format!("{odd:#x}")));
    }
    if let Some(place) = behind.iter().position(|&word| word != UNTOUCHED) {
        let found = format!("word {place} behind it is {:#x}", behind[place]);
        return Ok(Verdict::fail("nothing written behind the list", found));
    }
    Ok(Verdict::Pass(format!("{needed} of {count} threads appended, {stored} stored")))
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LinkPush {
    count: u32,
    capacity: u32,
    guard: u32,
    lists: u32,
}

fn linked(lab: &mut Lab, full: bool) -> Result<Verdict> {
    let count = threads(lab);
    let (lists, capacity) = (count / 50, if full { count / 3 } else { count + 10 });
    let program = pipeline(lab, &link::PROGRAM)?;
    let counter = words(lab, "link counter", &[0])?;
    let heads = words(lab, "link heads", &vec![0; lists as usize])?;
    let nodes = words(lab, "link nodes", &vec![UNTOUCHED; 2 * (capacity + GUARD) as usize])?;
    let push = LinkPush { count, capacity, guard: GUARD, lists };
    let bindings = link::Bindings { counter: &counter, heads: &heads, nodes: &nodes };
    lab.frames().run(|rec| rec.dispatch(&program, &bindings, &push, [count, 1, 1]))?;

    let wanted = read::<u32>(lab, &counter, 1)?[0];
    let expected = expected(lab, count);
    if wanted != expected {
        return Ok(Verdict::fail(format!("{expected} nodes asked for"), format!("a counter of {wanted}")));
    }
    let stored = count.min(capacity);
    let heads: Vec<u32> = read(lab, &heads, lists as usize)?;
    let nodes: Vec<[u32; 2]> = read(lab, &nodes, (capacity + GUARD) as usize)?;
    if let Some(place) = nodes[stored as usize..].iter().position(|node| *node != [UNTOUCHED; 2]) {
        return Ok(Verdict::fail("nothing written behind the nodes", format!("node {place} behind them is written")));
    }
    let mut met = vec![false; stored as usize];
    let mut seen = vec![false; count as usize];
    for (list, &first) in heads.iter().enumerate() {
        let mut next = first;
        while next != 0 {
            let Some(met) = met.get_mut(next as usize - 1) else {
                return Ok(Verdict::fail(
                    format!("nodes below {stored}"),
                    format!("list {list} leads to {}", next - 1),
                ));
            };
            let [after, id] = nodes[next as usize - 1];
            if std::mem::replace(met, true) {
                return Ok(Verdict::fail("every node met once", format!("list {list} meets node {} again", next - 1)));
            }
            if id >= count || hash(id) % lists != list as u32 || std::mem::replace(&mut seen[id as usize], true) {
                return Ok(Verdict::fail(format!("ids of list {list}, once each"), format!("id {id:#x}")));
            }
            next = after;
        }
    }
    let lost = met.iter().filter(|met| !**met).count();
    if lost > 0 {
        return Ok(Verdict::fail(format!("{stored} nodes in lists"), format!("{lost} that no list leads to")));
    }
    Ok(Verdict::Pass(format!("{stored} of {count} nodes in {lists} lists, each met once")))
}
