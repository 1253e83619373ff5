//! Volumetric cumulus skies in raw Vulkan 1.3.
//!
//! Clouds are thousands of particles lit from pre-computed scattering tables; where particles overlap they are blended as
//! volumes, ordered per pixel by fragment shader interlock where the device has it. The method is that of E. Yusov,
//! *High-Performance Rendering of Realistic Cumulus Clouds Using Pre-computed Lighting* (2014), cited as (Yusov, section or
//! equation) throughout.
//!
//! # Quick start
//! A program without a Vulkan device of its own:
//!
//! ```no_run
//! use std::ops::ControlFlow;
//! use welkin::gpu::standalone::{Options, Standalone};
//! use welkin::gpu::{Buffer, BufferKind};
//! use welkin::lut::{Detail, TableParams, Tables};
//! use welkin::renderer::{Renderer, TableImages};
//!
//! # fn main() -> welkin::Result<()> {
//! let mut params = welkin::Params::default(); // a good sky
//! params.clouds.coverage = welkin::params::Coverage::Uniform(0.4);
//! let size = [1280, 720];
//!
//! let mut device = Standalone::new(Options::default())?;
//! let gpu = device.gpu().clone();
//! let tables = TableParams::new(&params.clouds, Detail::Full);
//! let tables = Tables::load_or_build(device.frames(), &tables, None, &mut |_| ControlFlow::Continue(()))?;
//! let Some(tables) = tables else { return Ok(()) }; // somebody broke it off
//! let tables = TableImages {
//!     optical_depth: tables.optical_depth.image(),
//!     scattering: tables.scattering.image(),
//!     fill: tables.fill(),
//! };
//!
//! let mut renderer = Renderer::new(&gpu, &params, size, device.frames().slots())?;
//! let readback = Buffer::new(&gpu, "picture", u64::from(size[0] * size[1]) * 8, BufferKind::Readback)?;
//! loop {
//!     let (slot, ()) = device.frames().submit(|rec| {
//!         renderer.record(rec, &params.camera, tables)?;
//!         rec.copy_image_to_buffer(&renderer.film().picture, &readback);
//!         rec.make_visible_to_host(&readback);
//!         Ok(())
//!     })?;
//!     device.frames().wait()?;
//!     if !renderer.finish(&gpu, slot)? {
//!         break; // every list was large enough
//!     }
//!     device.frames().state().forget();
//! }
//! let rgba: Vec<[u16; 4]> = readback.read(0, (size[0] * size[1]) as usize); // toned, sRGB
//! # drop(rgba);
//! # Ok(())
//! # }
//! ```
//!
//! Parameters are plain data and are checked before anything is made of them:
//!
//! ```
//! let mut params = welkin::Params::default();
//! params.clouds.altitude = f32::NAN;
//! let text = params.validate().unwrap_err().to_string();
//! assert!(text.starts_with("clouds.altitude = NaN: expected"));
//! ```
//!
//! # Inside an engine
//! Welkin records into a command buffer that it is given, on a device that it is given, into images that it is lent. Nothing
//! is submitted, waited for, allocated or compiled in a frame. `examples/embed.rs` is a complete host; in short:
//!
//! 1. Create the device with [`gpu::DeviceFeatures::WANTED`] ([`gpu::limits_wanted`] lists the limits), with
//!    `fragmentShaderPixelInterlock` where there is one, and hand it over: [`gpu::Gpu::from_raw`], whose `# Safety` is what
//!    the host owes. Allocator, pipeline cache and [`gpu::PipelineFactory`] may be the host's.
//! 2. Make the tables ([`lut::Tables`]) once per medium, a [`renderer::Renderer`] once per size, a [`frame::Output`] once per
//!    format, and one [`gpu::RecorderState`].
//! 3. Each frame: [`gpu::RecorderState::begin`] on the host's command buffer, then
//!    [`Renderer::record_frame`](renderer::Renderer::record_frame) with [`frame::FrameInputs`] (camera, and the host's opaque
//!    distances if there are any) and [`frame::FrameOutput`]. Every [`frame::Lent`] image states access and layout on entry
//!    and on exit. The sun moves by [`Renderer::set_sun`](renderer::Renderer::set_sun), clouds by [`Renderer::set_time`](renderer::Renderer::set_time).
//! 4. When a frame has ended, [`Renderer::wants_more`](renderer::Renderer::wants_more) tells whether a list was too small.
//!
//! Every pipeline is described as data ([`gpu::PipelineDesc`]) before it is built: `welkin devices --pipelines` prints them
//! all, `examples/pipeline_state.rs` changes some.
//!
//! # The tour, in frame order
//! Source, shaders, tests and passes share these names: `src/grid`, `glsl/grid`, `tests/oracle_grid.rs`, pass "grid".
//!
//! | stage | what it does |
//! |---|---|
//! | [`lut`] | once per medium: optical depth and scattering of the reference particle, solved on the device, cached on disk |
//! | [`density`] | where clouds are: a world-anchored field, calibrated to the coverage asked for |
//! | [`grid`] | nested rings of cells around the camera → valid cells → particles; or an explicit list |
//! | [`compact`] | visible particles, in order, sorted back to front, into an indirect draw |
//! | [`tiling`] | lists of occluders per light-space tile, front to back along the light |
//! | [`lighting`] | sunlight that reaches each particle; what they scatter, diffusing through all of them; skylight |
//! | [`atmosphere`] | clear air: tables, light on clouds and ground, sky and ground behind, cloud shadows |
//! | [`blend`] | particles → segments of view rays → radiance, transmittance, nearest distance |
//! | [`film`] | air in front of the clouds, edge-preserving upsampling, compositing, exposure and tone curve |
//! | [`frame`] | the host's images, in and out |
//!
//! A [`sky::Sky`] records what the views of a frame share (particles, light, air), a [`view::View`] what one of them sees
//! (visible particles, compositing, picture); [`renderer`] is one of each. Source, lighting and compositing are axes: each choice
//! is a module of its own, chosen by name from one table ([`params::SOURCES`], [`params::LIGHTINGS`], [`params::BLENDS`]).
//! A stage reads what earlier ones wrote. [`gpu`] is the layer below, which derives
//! every barrier from what the shaders declare. [`params`] say what is rendered; `scene` reads them from a file, `output`
//! writes pictures and tables, `compare` measures pictures against a reference (all with feature `files`); [`reference`](mod@reference) holds the oracles: one plain CPU implementation for each stage.
//! `conform` (with its feature) tries what a driver must do for all this.
//!
//! # Units and conventions
//! - SI units: metres, 1/m for extinction. Radiance is spectral, W m⁻² sr⁻¹ nm⁻¹, at 680, 550 and 440 nm for r, g and b; angles
//!   in [`params`] are degrees, everywhere else radians.
//! - Right-handed world, +y up, +x east, −z north, `y = 0` at sea level. The host's positions are absolute `f64`; on the device
//!   they are `f32` relative to a *floating origin*: the camera's x and z snapped to 1024 m.
//! - `sigma_t` is extinction \[1/m\], `tau` optical depth \[1\], `albedo` scattering over extinction. A particle's extinction is
//!   `sigma_t · density · fade · profile`. Its *optical radius* is extinction times radius.
//! - Directions point away from the point: `to_sun`, `to_eye`. `cos_theta = -dot(to_light, to_eye)`, so +1 is forward.
//! - Suffixes name spaces: `_ws` world, `_vs` view, `_ls` light, `_us` a particle's unit ball.
//! - A segment's colour is `C = L_in / (1 − T)`, not premultiplied: its mean source function. Images hold `L_in` and `T`.
//! - Row 0 is the top of the picture; rays go through pixel centres. Distances are along the ray, 1e30 where there is nothing.
//! - A stage with arbitrary order inside (atomics) ends in a defined order: equal parameters give equal bits.
//!
//! # Departures from the papers and from the authors' code
//! What Welkin does otherwise than the paper, why, and the test that holds it. Slips of the authors' released code are
//! marked †.
//!
//! Tables (Yusov 4, 5.1):
//! - **Indexed by optical radius**, not by a density scale ρ = 2^s at one size: one set serves particles of every size and
//!   any `sigma_t`. (`tests/tables.rs::single_scattering_agrees_with_quadrature_at_texels_and_between`)
//! - **Azimuth over half the circle**: the light field is mirror symmetric about the plane of ray and sun, so 64 texels span
//!   [0, π]. (`src/reference/sphere.rs::coordinates_and_rays_are_inverse`)
//! - **The ray is described as the eye sees it**, by scattering angle and zenith of entry, not by the zenith of the entry point
//!   about the sun: the forward peak then lies along one axis. Rays only enter, so no view angle beyond π/2 is folded by a
//!   clamp†. (`src/lut/axes.rs::texel_centres_map_back_to_themselves_and_domain_ends_are_texels`)
//! - **Source functions are stored**, L / (1 − e^−τ), single scattering less a closed form: they stay smooth where the chord
//!   shrinks to nothing. Radiance is multiplied by (1 − T) once, in compositing (twice†).
//!   (`tests/tables.rs::multiple_scattering_agrees_with_monte_carlo_at_every_density_and_between`)
//! - **Scattering orders are summed until they converge** by a Krylov solver in angular momentum; the paper stops at 18, which
//!   loses light in thick bodies (`orders = 18` is an option). (`tests/tables.rs::no_energy_is_lost_or_made`,
//!   `tests/transport.rs::isotropic_scattering_agrees_with_the_exact_solution_of_the_sphere`)
//! - **The single-scattering light path is scaled by density**† like the view path: both are part of one optical radius.
//!   (`src/reference/scattering.rs::lit_from_behind_the_eye_through_the_centre_single_scattering_is_half_of_an_absorbed_round_trip`)
//!
//! Particles (Yusov 5.2):
//! - **Particles are sorted one by one by distance** on the device, stably; the paper sorts cells on the CPU and drops the
//!   invalid ones. Neighbouring cells' bodies overlap, so the order of cells is not the order of particles.
//!   (`tests/oracle_compact.rs::every_particle_in_view_is_drawn_once_back_to_front`)
//! - **Coarse particles go on inside the finer ring** as cores of its bodies, so that the switch between rings shows the same
//!   heaps. (`tests/oracle_grid.rs::cells_and_particles_are_those_of_the_reference`,
//!   `src/grid/params.rs::the_rings_weights_add_up_to_one_everywhere`)
//! - **Cells and seeds are anchored to the world**, not to the camera's grid: nothing swims.
//!   (`src/grid/params.rs::particles_stay_where_they_are_when_the_camera_and_the_origin_move`)
//!
//! Light (Yusov 5.3):
//! - **One grid of light tiles for each ring**, not one for all: 64² tiles over 200 km would put thousands of particles in a
//!   list. (`tests/oracle_lighting.rs::no_occluder_is_missed_whatever_the_suns_height`)
//! - **Lists are the same with and without interlock**: without it, insertion by atomic exchange and a merge sort. CPU devices
//!   sort although they have it, because that is faster there.
//!   (`tests/oracle_tiling.rs::lists_are_the_same_however_they_are_ordered`)
//! - **Nodes know what part of their tile they cover**, and particles are reduced along the light once a frame: four in five
//!   nodes of a walk miss, at one comparison each. Twice as fast on lavapipe.
//!   (`tests/oracle_lighting.rs::long_thin_occluders_far_away_are_as_exact_as_near_ones`)
//! - **An occluder counts with its own density**, not with the receiver's†.
//!   (`tests/oracle_lighting.rs::an_occluder_counts_with_its_own_density`)
//! - **Light is found at three points of a particle**, both poles towards the sun and the centre: overlapping particles agree on
//!   the light between them. (`tests/oracle_lighting.rs::no_occluder_is_missed_whatever_the_suns_height` checks all three)
//! - **Light that particles scatter diffuses through all of them**: the diffusion equation is solved in voxels around the
//!   camera, and shading looks its solution up where the eye looks, with a share of first-scattered light where voxels are
//!   optically thick (`docs/lighting.md`). In the paper particles see each other
//!   as occluders only. (`tests/light_volume.rs`)
//! - **Sunlight for a particle's own multiple scattering fades as exp(−ξ τ), ξ = 0.02**, and what comes straight from the sun
//!   as exp(−τ). The paper dims all of it by exp(−ξ τ), ξ = 0.05, which is an option (`clouds.transfer`) that does without the voxels.
//!   `docs/accuracy.md` tells what both gain against path tracing. (`src/reference/lighting.rs::alone_a_particle_keeps_all_its_light_and_in_shade_less_and_less`,
//!   `tests/oracle_lighting.rs::no_occluder_is_missed_whatever_the_suns_height`)
//! - **No smoothing by default**: against path tracing it gains nothing once light fades as above.
//!   (`tests/oracle_lighting.rs::smoothing_and_skylight_are_those_of_the_reference`)
//! - **Smoothing takes the layer below layer 1 too** (skipped†).
//!   (`tests/oracle_lighting.rs::layer_one_is_smoothed_with_the_layer_below_it`)
//! - **Every particle is lit**, seen or not: light must not change when the camera turns.
//!   (`tests/oracle_lighting.rs::smoothing_and_skylight_are_those_of_the_reference`)
//! - **Shadows can be had from a volume** (Shimada et al., *Real-time Rendering of Dynamic Clouds*), of which the paper draws
//!   every particle into all slices behind it. Here a particle adds the ends of its optical depths' ramps, as integers, and two sums along
//!   the light make the rest: the same volume for its area alone. What is scattered more than once is two streams along the
//!   sun's ray; the paper says nothing of it. (`tests/oracle_attenuation.rs::every_voxel_of_a_heap_in_a_high_sun_and_of_a_field_in_a_low_one_is_that_of_the_reference`,
//!   `tests/oracle_attenuation.rs::the_order_of_particles_changes_no_bit`)
//!
//! Forward scattering (Harris 2.2–2.3, Stoian 3–4; `docs/lighting.md`):
//! - **What goes on forward is albedo × (1 − e^−τ) × the phase function over the cone γ**, the papers' albedo × τ × p γ / 4π for
//!   thin particles and narrow cones, which for thick ones makes light.
//!   (`src/reference/forward.rs::energy_never_grows_for_any_cone_and_all_of_it_goes_on_at_albedo_1_in_the_whole_sphere`)
//! - **Each place scatters on the light that it holds itself**, not what the middle of the particle reads: order matters within
//!   a place alone, and particles need not wait for one another.
//!   (`src/reference/forward.rs::a_fine_buffer_blended_as_published_differs_by_where_scattered_light_is_taken`)
//! - **No buffer**: particles walk the light tiles' lists, which end in the same order with and without interlock; a buffer's
//!   texels can be had. (`tests/oracle_forward.rs::light_on_every_particle_of_a_list_is_the_references_and_the_same_from_interlock_and_sorting`)
//! - **The square that a particle reads is four points of it, and no wider than half of the particle.**
//!   (`tests/oracle_forward.rs::light_on_every_particle_of_a_grid_is_the_references`)
//!
//! Shading (Yusov 4.4, 5.4):
//! - **Detail noise displaces the surface**, along silhouettes too, in octaves anchored to the world; the paper does not say how
//!   it adds it. (`tests/oracle_detail.rs::every_texel_of_the_tile_is_the_noise_at_its_centre`,
//!   `tests/reference.rs::rendered_silhouettes_are_those_of_the_traced_density`)
//! - **Closed sky shines** with three quarters of the mean of sky and ground: cloud that absorbs nothing is not black in the
//!   shade of its like. Fitted to path-traced skies (`docs/accuracy.md`).
//!
//! Compositing (Yusov 5.5):
//! - **Transmittance is exp(−Σ τ)**, summed beside the merge, hence exact for any number of particles in any order.
//!   (`tests/blend.rs::transmittance_is_exactly_the_sum_of_optical_depths_in_any_order`)
//! - **Front and back each belong to whichever particle owns them**, so that containment is right too; the
//!   paper gives the front to one and the back to the other. (`src/reference/segments.rs::the_merge_is_exact_for_two_in_either_order_containment_included`)
//! - **The merge is the paper's by default, K = 1**: exact for two overlapping particles, approximate for three or more.
//!   (`tests/blend.rs::two_overlapping_ellipsoids_match_the_exact_integral_under_interlock`,
//!   `src/reference/segments.rs::three_overlapping_segments_tell_the_modes_apart`)
//! - **A window of K = 2, 4 or 8 pending segments** can be had in place of one, in storage images or in attachments: overlaps
//!   are split, and what is expected to cost least is merged or committed. (`tests/window.rs::the_error_falls_with_the_window_as_expected`)
//!
//! Air (Yusov 5.6 uses Bruneton's tables and epipolar sampling; here Hillaire, *A Scalable and Production Ready Sky*, 2020):
//! - **Aerosol single scattering is stored without its phase function**, so that the aureole stays sharp, and **aerial
//!   perspective lives in directions relative to the sun**, so that it does not change when the camera turns.
//!   (`tests/oracle_atmosphere.rs::tables_follow_the_oracle`)
//! - **Ground under clouds gets what a two-stream layer lets through**, 1 / (1 + 3/4 (1 − g) τ), not exp(−τ): an overcast day is
//!   grey, not black (`glsl/atmosphere/cloud_shadow.comp`; no test of its own yet).
//! - **Shafts of light come from the map of cloud shadows**, not from epipolar samples.
//!   (`tests/oracle_atmosphere.rs::shadow_takes_the_sunlit_air_below_the_clouds_away`)

#![deny(clippy::unwrap_used, clippy::expect_used)] // Tests and examples may.

pub mod atmosphere;
pub mod blend;
pub mod compact;
#[cfg(feature = "files")]
pub mod compare;
#[cfg(feature = "conform")]
pub mod conform;
pub mod definitions;
pub mod density;
pub mod detail;
pub mod error;
pub mod film;
pub mod frame;
pub mod gpu;
pub mod grid;
pub mod lighting;
pub mod lists;
pub mod lut;
#[cfg(feature = "files")]
pub mod output;
pub mod params;
pub mod pathtrace;
pub mod reference;
pub mod renderer;
pub mod scatter;
#[cfg(feature = "files")]
pub mod scene;
pub mod shared;
pub mod sky;
mod source;
mod targets;
mod threads;
pub mod tiling;
pub mod view;
pub mod voxelize;

/// Every shader program, as compiled and reflected by the build.
pub mod shaders {
    include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
}

pub use error::{Error, Result};
pub use params::Params;
