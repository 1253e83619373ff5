//! Lighting `forward`: multiple forward scattering along each light, and single scattering to the eye (Harris 2.2–2.3, Stoian
//! 3–4; `docs/lighting.md`).
//!
//! Light that comes in on each particle is found by walking the lists of the light's tiles front to back
//! (`glsl/lighting/forward/incident.comp`), once a frame for each light. Nothing is drawn and nothing read back.

pub mod serial;

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::{Lent, Method, Scene, Setting};
use crate::Result;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Gpu, Recorder, Resource};
use crate::grid::{Counters, ParticleSet};
use crate::lists::ListUse;
use crate::params::{Clouds, Forward, ForwardPhase, LIGHT_CAPACITY, Light, LightFrom, Phase, SkyModel, Splat};
use crate::reference::forward::cone_share;
use crate::reference::phase::PhaseFunction;
use crate::shaders::{lighting_forward_fold_comp as fold, lighting_forward_incident_comp as incident};
use crate::shared::assert_layout;
use crate::tiling::{NODES_PER_PARTICLE, Tiling, TilingParams};

/// One light, as shading reads it (`glsl/lighting/forward/params.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LightParams {
    /// Unit direction towards it.
    pub to_light: [f32; 3],
    /// Whose irradiance `colour` scales: 0 the sun's, 1 the sky's, 2 its own.
    pub from: u32,
    /// Share, or irradiance [W m⁻² nm⁻¹].
    pub colour: [f32; 3],
    /// Zero.
    pub reserved: u32,
}
assert_layout!(LightParams, forward_light, { to_light: TO_LIGHT, from: FROM, colour: COLOUR, reserved: RESERVED });

/// All lights, as shading reads them (`glsl/lighting/forward/params.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ForwardParams {
    /// Lights in use.
    pub count: u32,
    /// 0: Cornette–Shanks, which with asymmetry 0 is Rayleigh's; 1: Henyey–Greenstein.
    pub phase_function: u32,
    /// Asymmetry.
    pub g: f32,
    /// Single-scattering albedo.
    pub albedo: f32,
    /// The lights.
    pub light: [LightParams; LIGHT_CAPACITY],
}
assert_layout!(ForwardParams, forward_params, {
    count: COUNT, phase_function: PHASE_FUNCTION, g: G, albedo: ALBEDO, light: LIGHT,
});

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct IncidentPush {
    light: u32,
    profile: u32,
    forward: f32,
    root_angle: f32,
    resolution: f32,
}

/// Phase function and asymmetry that `clouds` have under lighting `forward`. Rayleigh's is that of Cornette and Shanks with
/// asymmetry 0.
#[must_use]
pub fn phase_of(clouds: &Clouds) -> (PhaseFunction, f32) {
    match clouds.forward.phase {
        ForwardPhase::Rayleigh => (PhaseFunction::CornetteShanks, 0.0),
        ForwardPhase::Scene => (clouds.phase.into(), clouds.g_single),
    }
}

/// Share of the light that a particle takes out of its way which goes on in the cone γ: albedo × phase function over the cone.
#[must_use]
pub fn forward_share(clouds: &Clouds) -> f64 {
    let (phase, g) = phase_of(clouds);
    f64::from(clouds.albedo) * cone_share(phase, g.into(), clouds.forward.solid_angle.into())
}

fn splat_index(splat: Splat) -> u32 {
    match splat {
        Splat::Gaussian => 0,
        Splat::Polynomial => 1,
    }
}

/// Finds the light that comes in on particles from one light at a time.
pub struct IncidentPass {
    pipeline: ComputePipeline,
    incident: Buffer,
    capacity: u32,
}

impl IncidentPass {
    /// For `capacity` particles.
    pub fn new(gpu: &Arc<Gpu>, capacity: u32) -> Result<Self> {
        Ok(Self {
            pipeline: ComputePipeline::new(gpu, &incident::PROGRAM, &[])?,
            incident: Buffer::array::<[f32; LIGHT_CAPACITY]>(gpu, "incident light", capacity as usize)?,
            capacity,
        })
    }

    /// Of every particle the share of each light that comes in on it, [`LIGHT_CAPACITY`] numbers.
    #[must_use]
    pub fn incident(&self) -> &Buffer {
        &self.incident
    }

    /// Records light number `light`, whose lists are the `slot`th of `tiling`.
    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        light: u32,
        (tiling, slot): (&Tiling, usize),
        set: &ParticleSet,
        clouds: &Clouds,
    ) -> Result<()> {
        assert!(set.capacity() <= self.capacity, "the particle set has grown: call grow() too");
        let Forward { solid_angle, resolution, splat, .. } = clouds.forward;
        rec.dispatch_indirect(
            &self.pipeline,
            &incident::Bindings {
                params: tiling.params(slot),
                occluders: tiling.occluders(),
                tile_heads: tiling.heads(),
                tile_nodes: tiling.nodes(),
                counters: set.counters(),
                incident: &self.incident,
            },
            &IncidentPush {
                light,
                profile: splat_index(splat),
                forward: forward_share(clouds) as f32,
                root_angle: solid_angle.sqrt(),
                resolution: resolution as f32,
            },
            set.args(),
            ParticleSet::PARTICLE_ARGS,
        )
    }

    /// Follows a [`ParticleSet`] that has grown; the device must be idle. True if it did.
    pub fn grow(&mut self, gpu: &Arc<Gpu>, set: &ParticleSet) -> Result<bool> {
        if set.capacity() <= self.capacity {
            return Ok(false);
        }
        *self = Self::new(gpu, set.capacity())?;
        Ok(true)
    }
}

/// Tiles of the lights other than the sun, one light after the other.
struct OtherTiles {
    tiling: Tiling,
    /// Counts nodes of one light apart from the sun's.
    counters: Buffer,
    fold: ComputePipeline,
}

/// The lighting method.
pub(super) struct ForwardLight {
    pass: IncidentPass,
    others: Option<OtherTiles>,
    params: Vec<Buffer>,
}

/// Lights that shine under `sky`: without an atmosphere the sky does not.
fn shining(clouds: &Clouds, sky: SkyModel) -> impl Iterator<Item = &Light> {
    clouds.forward.lights.iter().filter(move |light| sky != SkyModel::None || light.from != LightFrom::Sky)
}

impl ForwardLight {
    pub(super) fn new(setting: &Setting<'_>) -> Result<Self> {
        let Setting { gpu, params, capacity, levels, slots, .. } = *setting;
        let others = shining(&params.clouds, params.sky.model).filter(|light| light.direction.is_some()).count();
        let others = if others > 0 {
            let nodes = capacity.saturating_mul(NODES_PER_PARTICLE);
            Some(OtherTiles {
                tiling: Tiling::new(gpu, levels, capacity, nodes, slots * LIGHT_CAPACITY)?,
                counters: Buffer::array::<Counters>(gpu, "light counters", 1)?,
                fold: ComputePipeline::new(gpu, &fold::PROGRAM, &[])?,
            })
        } else {
            None
        };
        let params = (0..slots)
            .map(|_| Buffer::new(gpu, "forward params", size_of::<ForwardParams>() as u64, BufferKind::Upload))
            .collect::<Result<_>>()?;
        Ok(Self { pass: IncidentPass::new(gpu, capacity)?, others, params })
    }
}

impl Method for ForwardLight {
    fn record(&mut self, rec: &mut Recorder<'_>, scene: &Scene<'_>) -> Result<()> {
        let (clouds, set, slot) = (&scene.params.clouds, scene.set, rec.slot());
        let (phase, g) = phase_of(clouds);
        let mut params = ForwardParams {
            phase_function: u32::from(phase == Phase::HenyeyGreenstein.into()),
            g,
            albedo: clouds.albedo,
            ..ForwardParams::zeroed()
        };
        let lights: Vec<Light> = shining(clouds, scene.params.sky.model).copied().collect();
        for (index, light) in lights.iter().enumerate() {
            let to_light = light.direction.unwrap_or(scene.to_sun);
            let from = match light.from {
                LightFrom::Sun => 0,
                LightFrom::Sky => 1,
                LightFrom::Own => 2,
            };
            params.light[index] =
                LightParams { to_light: to_light.map(|c| c as f32), from, colour: light.colour, reserved: 0 };
            params.count += 1;
            match (light.direction, &self.others) {
                (Some(direction), Some(others)) => {
                    let at = slot * LIGHT_CAPACITY + index;
                    let tiles = TilingParams::new(direction, &scene.layer.slab(), clouds.sigma_t * scene.fill);
                    rec.pass("tiling", |rec| {
                        rec.copy_buffer(set.counters(), &others.counters, size_of::<Counters>() as u64);
                        let nodes = u64::from(Counters::TILE_NODES) * 4;
                        rec.fill_buffer(&others.counters, nodes, 4, 0);
                        others.tiling.record_at(rec, at, &tiles, set, &others.counters)?;
                        let bindings = fold::Bindings { counters: set.counters(), light_counters: &others.counters };
                        rec.dispatch(&others.fold, &bindings, &(), [1, 1, 1])
                    })?;
                    rec.pass("lighting", |rec| self.pass.record(rec, index as u32, (&others.tiling, at), set, clouds))?;
                }
                _ => {
                    rec.pass("lighting", |rec| self.pass.record(rec, index as u32, (scene.tiling, slot), set, clouds))?
                }
            }
        }
        self.params[slot].write(0, &[params]);
        Ok(())
    }

    fn resources<'a>(&'a self, lent: &Lent<'a>) -> Vec<(&'static str, Resource<'a>)> {
        vec![
            ("incident", Resource::Buffer(self.pass.incident())),
            ("sky_light", Resource::Buffer(lent.sky_light)),
            ("forward", Resource::Buffer(&self.params[lent.slot])),
        ]
    }

    fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters, set: &ParticleSet) -> Result<bool> {
        let mut grew = self.pass.grow(gpu, set)?;
        if let Some(others) = &mut self.others {
            grew |= others.tiling.grow(gpu, counters, set)?;
        }
        Ok(grew)
    }

    fn lists(&self, counters: &Counters) -> Vec<ListUse> {
        let list = |others: &OtherTiles| ListUse {
            name: "light_nodes",
            needed: counters.tile_nodes,
            capacity: others.tiling.node_capacity(),
        };
        self.others.iter().map(list).collect()
    }
}
