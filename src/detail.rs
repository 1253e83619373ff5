//! The tile of billow noise that gives particles their fine surface (Yusov 5.4: "3D noise is used to add small
//! details"). Filled once per device by `glsl/detail/billow.comp`, read by `glsl/detail/displace.glsl`.

use crate::Result;
use crate::gpu::{ComputePipeline, Gpu, Image, ImageDesc, Once, Recorder};
use crate::shaders::detail_billow_comp as shader;
use ash::vk;
use std::sync::Arc;

/// Texels along an edge of the tile.
pub const TILE_SIZE: u32 = 64;

/// The tile and what fills it.
pub struct DetailTile {
    pipeline: ComputePipeline,
    filled: Once,
    /// 64³ texels: gradient in xyz [1/cell], value in w.
    pub image: Image,
}

impl DetailTile {
    /// An unfilled tile.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let image = Image::new(
            gpu,
            &ImageDesc {
                name: "detail tile",
                extent: [TILE_SIZE; 3],
                format: vk::Format::R16G16B16A16_SFLOAT,
                usage: vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::SAMPLED,
            },
        )?;
        Ok(Self { pipeline: ComputePipeline::new(gpu, &shader::PROGRAM, &[])?, filled: Once::new(), image })
    }

    /// Fills the tile, the first time.
    pub fn record(&self, rec: &mut Recorder<'_>) -> Result<()> {
        rec.once(&self.filled, |rec| {
            rec.pass("detail", |rec| {
                rec.dispatch(&self.pipeline, &shader::Bindings { tile: &self.image }, &(), [TILE_SIZE; 3])
            })
        })
    }
}
