//! Light tile lists on the device against `welkin::reference::tiling`.

#[path = "support/clouds.rs"]
mod clouds;

use clouds::{Setup, Stages, open, read, silent};
use welkin::gpu::Feature;
use welkin::gpu::standalone::Standalone;
use welkin::reference::tiling::{in_list_order, tile_range};
use welkin::shared::Particle;
use welkin::tiling::params::NO_NODE;
use welkin::tiling::{ListOrder, TileNode, Tiling};

/// Particles of every tile's list, in the list's order.
fn lists(heads: &[u32], nodes: &[TileNode]) -> Vec<Vec<u32>> {
    heads
        .iter()
        .map(|&head| {
            let mut list = Vec::new();
            let mut at = head;
            while at != NO_NODE {
                let node = nodes[at as usize];
                list.push(node.particle);
                assert!(list.len() <= nodes.len(), "a list runs in a circle");
                at = node.next;
            }
            list
        })
        .collect()
}

/// The ways to order lists that the device has; the driver without interlock proves one.
fn orders(device: &Standalone) -> Vec<ListOrder> {
    let interlock = device.gpu().capabilities().supports(Feature::FragmentShaderInterlock).is_ok();
    if interlock { vec![ListOrder::Sort, ListOrder::Interlock] } else { vec![ListOrder::Sort] }
}

fn tiling(device: &Standalone, setup: &Setup, nodes: u32, order: ListOrder) -> Tiling {
    let particles = setup.design().particle_estimate();
    Tiling::with_order(device.gpu(), setup.quality.rings, particles, nodes, 2, order).unwrap()
}

#[test]
fn lists_are_the_same_however_they_are_ordered() {
    for elevation in [1.0f64, 20.0, 90.0] {
        let (elevation, azimuth) = (elevation.to_radians(), 80.0f64.to_radians());
        let to_sun = [elevation.cos() * azimuth.sin(), elevation.sin(), -elevation.cos() * azimuth.cos()];
        let setup = Setup { to_sun, ..Setup::default() };
        let mut device = open();
        let mut stages = Stages::new(&device, &setup);
        let mut results = orders(&device).into_iter().map(|order| {
            stages.tiling = tiling(&device, &setup, 1 << 22, order);
            device.frames().state().forget();
            let counters = stages.run(&mut device, &setup);
            assert!(counters.tile_nodes <= stages.tiling.node_capacity());
            let heads: Vec<u32> = read(&mut device, stages.tiling.heads(), setup.tiling_params().tile_count());
            let nodes: Vec<TileNode> = read(&mut device, stages.tiling.nodes(), counters.tile_nodes);
            lists(&heads, &nodes)
        });
        let first = results.next().unwrap();
        assert!(results.all(|other| other == first), "{elevation}");
        drop(results);
        silent(&device);
    }
}

#[test]
fn lists_hold_what_covers_the_tile_front_to_back() {
    for elevation in [2.0f64, 35.0, 90.0] {
        let (elevation, azimuth) = (elevation.to_radians(), 150.0f64.to_radians());
        let to_sun = [elevation.cos() * azimuth.sin(), elevation.sin(), -elevation.cos() * azimuth.cos()];
        let setup = Setup { to_sun, ..Setup::default() };
        let mut device = open();
        let stages = Stages::new(&device, &setup);
        let counters = stages.run(&mut device, &setup);
        let t = setup.tiling_params();
        let particles: Vec<Particle> = read(&mut device, stages.set.particles(), counters.stored);
        let heads: Vec<u32> = read(&mut device, stages.tiling.heads(), t.tile_count());
        assert!(counters.tile_nodes <= stages.tiling.node_capacity());
        let nodes: Vec<TileNode> = read(&mut device, stages.tiling.nodes(), counters.tile_nodes);
        let lists = lists(&heads, &nodes);

        assert_eq!(lists.iter().map(Vec::len).sum::<usize>(), counters.tile_nodes as usize);
        let longest = lists.iter().map(Vec::len).max().unwrap();
        assert!(longest > 20, "lists must be long enough for their order to matter");
        assert!((1..=longest).contains(&(counters.longest_walk as usize)));
        for list in &lists {
            assert_eq!(*list, in_list_order(list.clone(), &particles, &t));
        }

        // A particle in a level's lists is in every tile that it covers there, and in no other.
        for level in 0..t.level_count {
            let tiles = (level * t.tile_dim * t.tile_dim) as usize;
            let here = &lists[tiles..tiles + (t.tile_dim * t.tile_dim) as usize];
            let mut listed = vec![Vec::new(); particles.len()];
            for (tile, list) in here.iter().enumerate() {
                let dim = t.tile_dim as usize;
                list.iter().for_each(|&p| listed[p as usize].push([(tile % dim) as i64, (tile / dim) as i64]));
            }
            for (particle, tiles) in particles.iter().zip(&listed).filter(|(_, tiles)| !tiles.is_empty()) {
                let must = tile_range(particle, level, 0.0, &t);
                let may = tile_range(particle, level, 0.02, &t);
                let inside = |tile: &[i64; 2], range: [[i64; 2]; 2]| {
                    (0..2).all(|axis| (range[0][axis]..=range[1][axis]).contains(&tile[axis]))
                };
                assert!(tiles.iter().all(|tile| inside(tile, may)), "{particle:?} {tiles:?} {may:?}");
                let needed = (0..2).map(|axis| (must[1][axis] - must[0][axis] + 1).max(0)).product::<i64>();
                assert_eq!(tiles.iter().filter(|tile| inside(tile, must)).count() as i64, needed, "{particle:?}");
            }
        }
        silent(&device);
    }
}

#[test]
fn a_list_that_is_too_short_loses_nodes_not_memory() {
    let setup = Setup::default();
    let mut device = open();
    let mut stages = Stages::new(&device, &setup);
    let gpu = device.gpu().clone();
    for order in orders(&device) {
        stages.tiling = tiling(&device, &setup, 500, order);
        let short = stages.run(&mut device, &setup);
        assert!(short.tile_nodes > 500);
        assert!(stages.tiling.grow(&gpu, &short, &stages.set).unwrap());
        device.frames().state().forget();
        let cured = stages.run(&mut device, &setup);
        assert_eq!(cured.tile_nodes, short.tile_nodes);
        assert!(!stages.tiling.grow(&gpu, &cured, &stages.set).unwrap());
    }
    silent(&device);
}
