//! The tile of billow noise as a device has stored it.

use welkin::detail::{DetailTile, TILE_SIZE};
use welkin::gpu::standalone::Standalone;
use welkin::gpu::{Buffer, BufferKind};

/// Fills the tile; its texels as 16-bit floats, x fastest: gradient in xyz, value in w.
pub fn texels(device: &mut Standalone) -> Vec<[half::f16; 4]> {
    let gpu = device.gpu().clone();
    let tile = DetailTile::new(&gpu).unwrap();
    let count = TILE_SIZE.pow(3) as usize;
    let bytes = Buffer::new(&gpu, "tile bytes", 8 * count as u64, BufferKind::Readback).unwrap();
    let run = device.frames().run(|rec| {
        tile.record(rec)?;
        rec.copy_image_to_buffer(&tile.image, &bytes);
        rec.make_visible_to_host(&bytes);
        Ok(())
    });
    run.unwrap();
    device.frames().state().forget(); // tile and bytes go
    bytes.read(0, count)
}
