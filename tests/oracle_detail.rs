//! The tile of billow noise on the device against its f64 reference.

#[path = "support/tile.rs"]
mod tile;

use welkin::detail::TILE_SIZE;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::reference::detail::{CELLS, billow};

#[test]
fn every_texel_of_the_tile_is_the_noise_at_its_centre() {
    let mut device = Standalone::new(Options { validation: true, ..Options::default() }).unwrap();
    let texels = tile::texels(&mut device);
    let scale = f64::from(CELLS) / f64::from(TILE_SIZE);
    let (mut sum, mut creases) = (0.0, 0);
    for (index, texel) in texels.iter().enumerate() {
        let index = index as u32;
        let at = [index % TILE_SIZE, index / TILE_SIZE % TILE_SIZE, index / TILE_SIZE.pow(2)];
        let (value, gradient) = billow(at.map(|c| (f64::from(c) + 0.5) * scale));
        let texel = texel.map(half::f16::to_f64);
        // f16 keeps 11 bits: 2^-11 of values up to 1, of slopes up to 4.
        assert!((texel[3] - value).abs() < 6e-4, "{at:?}: {} {value}", texel[3]);
        // On a crease two bumps tie, and rounding picks either slope.
        let same = (0..3).all(|i| (texel[i] - gradient[i]).abs() < 2.5e-3);
        creases += usize::from(!same);
        sum += value;
    }
    assert!(creases < texels.len() / 10_000, "{creases} slopes differ");
    let mean = sum / texels.len() as f64;
    assert!((0.4..0.8).contains(&mean), "a mean of {mean} is no billow");
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}
