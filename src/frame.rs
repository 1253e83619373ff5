//! What goes into a frame and what comes out: the host's images, each with the access it has on entry and on exit.
//!
//! A host lends images as data: [`Lent`] says how the host used the image last and how it wants it back, and the renderer
//! records the barriers at both ends. In between the image is in `GENERAL` layout and Welkin's alone.

use crate::Result;
use crate::film::Film;
use crate::gpu::{
    Access, Attachment, BlendState, Draw, Gpu, GraphicsPipeline, GraphicsState, Image, PipelineKind, Recorder, Sampler,
    Target,
};
use crate::params::Camera;
use crate::shaders::film_present_frag as present;
use ash::vk;
use std::sync::Arc;

/// The particle tables that shading reads. [`Tables`](crate::lut::Tables) makes them.
#[derive(Clone, Copy)]
pub struct TableImages<'a> {
    /// Optical depth of the reference particle (Yusov 4.1).
    pub optical_depth: &'a Image,
    /// Single and multiple scattering of the homogeneous sphere (Yusov 4.2, 4.3).
    pub scattering: &'a Image,
    /// Mean of the density profile along a chord through the middle of the particle.
    pub fill: f32,
}

/// An image of the host's, for the length of one recording.
#[derive(Clone, Copy)]
pub struct Lent<'a> {
    /// The image, wrapped by [`Image::borrow`] once and kept: a new wrapper costs a new descriptor set.
    pub image: &'a Image,
    /// The host's last use of it, and its layout then. `UNDEFINED` drops what it holds. For an image that a semaphore hands
    /// over (a swapchain's), name the access whose stage waits for the semaphore, with layout `UNDEFINED`.
    pub entry: (Access, vk::ImageLayout),
    /// The host's next use of it, and the layout it wants.
    pub exit: (Access, vk::ImageLayout),
}

/// What a frame is made from, besides the renderer's own parameters.
#[derive(Clone, Copy)]
pub struct FrameInputs<'a> {
    /// Where it is seen from.
    pub camera: &'a Camera,
    /// Particle tables. None will do for homogeneous particles with flat lighting, which read no table.
    pub tables: Option<TableImages<'a>>,
    /// The host's opaque scene: distance from the camera along the view ray [m] (not depth along the view axis), 1e30
    /// where there is nothing. `R32_SFLOAT`, usage `SAMPLED`, as many pixels as the picture, row 0 at the top. Clouds
    /// stand behind it, and the sky and the ground are left out where it is nearer.
    ///
    /// From a depth buffer `d`: distance = z(d) · length(x, y, 1), where z is the depth along the view axis and (x, y) the
    /// view ray's slopes.
    pub opaque_distance: Option<Lent<'a>>,
}

impl<'a> FrameInputs<'a> {
    /// A frame seen by `camera`, without opaque scene.
    #[must_use]
    pub fn new(camera: &'a Camera, tables: TableImages<'a>) -> Self {
        Self { camera, tables: Some(tables), opaque_distance: None }
    }
}

/// Where a frame goes.
#[derive(Clone, Copy)]
pub struct FrameOutput<'a> {
    /// What is written, and into what format.
    pub output: &'a Output,
    /// The image: usage `COLOR_ATTACHMENT`, as many pixels as the picture.
    pub target: Lent<'a>,
}

/// What the host's image gets.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum OutputKind {
    /// The toned picture, sRGB-encoded; a format that encodes by itself (`*_SRGB`) gets the same picture. Replaces.
    Picture,
    /// Scene radiance in rgb [W m⁻² sr⁻¹ nm⁻¹], transmittance of the clouds in a, for a host that tones by itself. Replaces.
    Radiance,
    /// The same, laid over what the image holds: rgb + a · what is there. The host draws its opaque scene first, black
    /// where there is none: there the radiance brings the sky.
    Over,
}

/// Writes finished frames into images of one format.
pub struct Output {
    pipeline: GraphicsPipeline,
    kind: OutputKind,
}

impl Output {
    /// The pipeline for images of `format`, which must be one that a colour attachment can have (and blend, for
    /// [`OutputKind::Over`]). A [`PipelineFactory`](crate::gpu::PipelineFactory) may change format and blend state.
    pub fn new(gpu: &Arc<Gpu>, kind: OutputKind, format: vk::Format) -> Result<Self> {
        let blend = if kind == OutputKind::Over { BlendState::OverTransmittance } else { BlendState::Replace };
        let decode = kind == OutputKind::Picture && encodes_srgb(format);
        let state = GraphicsState {
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            attachments: vec![Attachment { format, blend }],
            ..GraphicsState::default()
        };
        let pipeline = GraphicsPipeline::new(gpu, &present::PROGRAM, &[("DECODE", u32::from(decode))], state)?;
        Ok(Self { pipeline, kind })
    }

    /// What is written.
    #[must_use]
    pub fn kind(&self) -> OutputKind {
        self.kind
    }

    /// Format of the images, after the factory's changes.
    #[must_use]
    pub fn format(&self) -> vk::Format {
        match &self.pipeline.desc().kind {
            PipelineKind::Graphics(state) => state.attachments.first().map_or(vk::Format::UNDEFINED, |a| a.format),
            PipelineKind::Compute => vk::Format::UNDEFINED,
        }
    }

    /// Records the writing of `film` into `target`, and both of its barriers.
    ///
    /// # Panics
    /// If the target's size is not the film's, its format not [`Self::format`], or [`OutputKind::Over`] is to be laid over
    /// contents that the entry layout `UNDEFINED` drops.
    pub fn record(&self, rec: &mut Recorder<'_>, film: &Film, target: &Lent<'_>) -> Result<()> {
        let source = if self.kind == OutputKind::Picture { &film.picture } else { &film.scene };
        let [width, height, _] = source.extent();
        assert_size(target.image, [width, height]);
        let replaced = self.kind != OutputKind::Over;
        assert!(
            replaced || target.entry.1 != vk::ImageLayout::UNDEFINED,
            "{}: an output of kind Over needs contents, but the entry layout UNDEFINED drops them",
            target.image.name()
        );
        rec.acquire(target.image, target.entry.0, target.entry.1);
        let bindings = present::Bindings { source: source.sampled(Sampler::NearestClamp) };
        // Every pixel is written; without a clear only what a factory's blend state reads has to be loaded.
        let targets = [Target { image: target.image, clear: None }];
        let draw = Draw::Direct { vertices: 3, instances: 1 };
        rec.pass("output", |rec| rec.draw(&self.pipeline, &bindings, &(), [width, height], &targets, draw))?;
        rec.release(target.image, target.exit.0, target.exit.1);
        Ok(())
    }
}

/// Misuse of the interface: a lent image of another size than the picture.
pub(crate) fn assert_size(image: &Image, [width, height]: [u32; 2]) {
    let [w, h, _] = image.extent();
    assert!([w, h] == [width, height], "{}: {w}x{h} pixels, but the picture has {width}x{height}", image.name());
}

fn encodes_srgb(format: vk::Format) -> bool {
    matches!(format, vk::Format::R8G8B8A8_SRGB | vk::Format::B8G8R8A8_SRGB | vk::Format::A8B8G8R8_SRGB_PACK32)
}
