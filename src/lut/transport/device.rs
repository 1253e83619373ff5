//! The operator on the device: one application = emit, sweep, turn, project, for many total angular momenta at once.

use super::plan::{Plan, RaySet};
use crate::Result;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Frames, Gpu, Recorder};
use crate::shaders::{
    lut_transport_emit_comp as emit, lut_transport_project_comp as project, lut_transport_sweep_comp as sweep,
    lut_transport_turn_comp as turn,
};
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Twin of `TransportJob`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Job {
    j: u32,
    source: u32,
    field: u32,
    order: u32,
    rotation: u32,
    components: u32,
}

/// Twin of `TransportPoint`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct GpuPoint {
    weights: [f32; 4],
    cos_alpha: f32,
    sin_alpha: f32,
    pad: [f32; 2],
}

/// Twin of `TransportBucket`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Bucket {
    start: u32,
    count: u32,
    shell: u32,
    crossing: u32,
}

/// Invocations in a workgroup of the last pass.
const GROUP: u32 = 64;

/// Most points in a bucket: `TRANSPORT_BUCKET`.
const BUCKET: u32 = 128;

/// Points or crossings that one invocation works on: `TRANSPORT_EACH`.
const EACH: u32 = 4;

/// Largest field and radiance arrays of one block of jobs [elements]; bounds memory whatever the resolution.
const BLOCK_ELEMENTS: usize = 3 << 20;

/// The four pipelines.
pub struct Pipelines {
    emit: ComputePipeline,
    sweep: ComputePipeline,
    turn: ComputePipeline,
    project: ComputePipeline,
}

impl Pipelines {
    /// Builds them.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Ok(Self {
            emit: ComputePipeline::new(gpu, &emit::PROGRAM, &[])?,
            sweep: ComputePipeline::new(gpu, &sweep::PROGRAM, &[])?,
            turn: ComputePipeline::new(gpu, &turn::PROGRAM, &[])?,
            project: ComputePipeline::new(gpu, &project::PROGRAM, &[])?,
        })
    }
}

/// A set of rays on the device.
pub struct GpuRays {
    buckets: Buffer,
    bucket_count: usize,
    order: Buffer,
    points: Buffer,
    basis: Buffer,
    /// First point and number of points of each ray.
    pub rays: Buffer,
    steps: Buffer,
    point_count: usize,
    ray_count: usize,
}

impl GpuRays {
    fn new(gpu: &Arc<Gpu>, set: &RaySet, lms: usize) -> Result<Self> {
        // Shell and whether a point lies on it: the same for all points of a bucket.
        let mut places: Vec<(usize, bool)> = set.points.iter().map(|point| (point.first, false)).collect();
        for &(shell, point) in &set.crossings {
            places[point] = (shell, true);
        }
        let mut order: Vec<u32> = (0..places.len() as u32).collect();
        order.sort_by_key(|&p| places[p as usize]);
        let mut buckets = Vec::new();
        let mut start = 0;
        for alike in order.chunk_by(|&a, &b| places[a as usize] == places[b as usize]) {
            let (shell, crossing) = places[alike[0] as usize];
            for bucket in alike.chunks(BUCKET as usize) {
                let count = bucket.len() as u32;
                buckets.push(Bucket { start, count, shell: shell as u32, crossing: u32::from(crossing) });
                start += count;
            }
        }
        let points: Vec<GpuPoint> = (set.points.iter())
            .map(|point| GpuPoint {
                weights: point.weights.map(|w| w as f32),
                cos_alpha: point.cos as f32,
                sin_alpha: point.sin as f32,
                pad: [0.0; 2],
            })
            .collect();
        let count = points.len();
        let mut basis = vec![0.0f32; count * lms];
        for (place, &p) in order.iter().enumerate() {
            for c in 0..lms {
                basis[c * count + place] = set.basis[p as usize * lms + c] as f32;
            }
        }
        let steps: Vec<[f32; 4]> = set.points.iter().map(|point| point.step.map(|w| w as f32)).collect();
        let rays: Vec<[u32; 2]> = set.rays.iter().map(|&(first, count)| [first as u32, count as u32]).collect();
        Ok(Self {
            buckets: Buffer::upload(gpu, "transport buckets", &buckets)?,
            bucket_count: buckets.len(),
            order: Buffer::upload(gpu, "transport order of points", &order)?,
            points: Buffer::upload(gpu, "transport points", &points)?,
            basis: Buffer::upload(gpu, "transport basis", &basis)?,
            rays: Buffer::upload(gpu, "transport rays", &rays)?,
            steps: Buffer::upload(gpu, "transport steps", &steps)?,
            point_count: count,
            ray_count: rays.len(),
        })
    }

    /// Number of points.
    pub fn point_count(&self) -> usize {
        self.point_count
    }
}

/// A plan on the device.
pub struct DevicePlan<'a> {
    gpu: Arc<Gpu>,
    pipelines: &'a Pipelines,
    plan: &'a Plan,
    inner: GpuRays,
    outer: GpuRays,
    crossings: Buffer,
    ranges: Buffer,
    components: Buffer,
    projection: Buffer,
    moments: Buffer,
    rotations: Buffer,
    rotation_offsets: Vec<u32>,
    crossing_count: usize,
    sources_in: [Buffer; 2],
    sources_out: [Buffer; 2],
    field: Buffer,
    orders: Buffer,
}

fn total_source(plan: &Plan) -> usize {
    (0..=plan.resolution.j_max).map(|j| plan.components(j)).sum::<usize>() * plan.radii.len()
}

impl<'a> DevicePlan<'a> {
    /// Uploads a plan; `rotations` as from [`super::plan::rotations`].
    pub fn new(gpu: &Arc<Gpu>, pipelines: &'a Pipelines, plan: &'a Plan, rotations: &[Vec<Vec<f64>>]) -> Result<Self> {
        let lms = plan.lm.len();
        // Crossings, sorted by shell.
        let mut order: Vec<usize> = (0..plan.inner.crossings.len()).collect();
        order.sort_by_key(|&x| plan.inner.crossings[x].0);
        let count = order.len();
        let crossings: Vec<u32> = order.iter().map(|&x| plan.inner.crossings[x].1 as u32).collect();
        let ranges: Vec<[u32; 2]> = (0..plan.radii.len())
            .map(|shell| {
                let first = order.partition_point(|&x| plan.inner.crossings[x].0 < shell);
                let end = order.partition_point(|&x| plan.inner.crossings[x].0 <= shell);
                [first as u32, (end - first) as u32]
            })
            .collect();
        let mut projection = vec![0.0f32; count * lms];
        for (x, &old) in order.iter().enumerate() {
            for c in 0..lms {
                projection[c * count + x] = plan.projection[old * lms + c] as f32;
            }
        }
        let components: Vec<[u32; 2]> = plan.lm.iter().map(|&(l, m)| [l as u32, m as u32]).collect();
        let moments: Vec<f32> = plan.moments.iter().map(|&m| m as f32).collect();
        let (mut packed, mut rotation_offsets) = (Vec::new(), Vec::new());
        for (j, rotation) in rotations.iter().enumerate().take(plan.resolution.j_max + 1) {
            rotation_offsets.push(packed.len() as u32);
            for row in rotation {
                packed.extend(row[..=j.min(plan.resolution.l_max)].iter().map(|&v| v as f32));
            }
        }
        let source_bytes = (total_source(plan) * 4) as u64;
        let inner = GpuRays::new(gpu, &plan.inner, lms)?;
        let outer = GpuRays::new(gpu, &plan.outer, lms)?;
        let widest = plan.resolution.j_max / 2 + 1;
        let block = BLOCK_ELEMENTS.max(widest * inner.point_count);
        let all_terms: usize = (0..=plan.resolution.j_max).map(|j| j / 2 + 1).sum();
        let block = block.max(all_terms * outer.point_count);
        let buffer = |name, kind| Buffer::new(gpu, name, source_bytes, kind);
        Ok(Self {
            gpu: gpu.clone(),
            pipelines,
            plan,
            inner,
            outer,
            crossings: Buffer::upload(gpu, "transport crossings", &crossings)?,
            ranges: Buffer::upload(gpu, "transport shell ranges", &ranges)?,
            components: Buffer::upload(gpu, "transport components", &components)?,
            projection: Buffer::upload(gpu, "transport projection", &projection)?,
            moments: Buffer::upload(gpu, "transport moments", &moments)?,
            rotations: Buffer::upload(gpu, "transport rotations", &packed)?,
            rotation_offsets,
            crossing_count: count,
            sources_in: [
                buffer("transport source (host)", BufferKind::Upload)?,
                buffer("transport source", BufferKind::Device)?,
            ],
            sources_out: [
                buffer("transport scattered", BufferKind::Device)?,
                buffer("transport scattered (host)", BufferKind::Readback)?,
            ],
            field: Buffer::array::<[f32; 2]>(gpu, "transport field", block)?,
            orders: Buffer::array::<f32>(
                gpu,
                "transport radiance",
                BLOCK_ELEMENTS.max(count * (plan.resolution.l_max + 1)),
            )?,
        })
    }

    /// The view rays.
    pub fn outer(&self) -> &GpuRays {
        &self.outer
    }

    /// The field, which [`Self::view`] leaves filled for the view rays, `[j, k][point]`.
    pub fn field(&self) -> &Buffer {
        &self.field
    }

    fn job(&self, j: usize, source: usize, field: usize, order: usize) -> Job {
        Job {
            j: j as u32,
            source: source as u32,
            field: field as u32,
            order: order as u32,
            rotation: self.rotation_offsets[j],
            components: self.plan.components(j) as u32,
        }
    }

    /// Applies the operator to a source of each of `requests` (total angular momentum, source); results in their order.
    pub fn apply(&self, frames: &mut Frames, requests: &[(usize, &[f64])]) -> Result<Vec<Vec<f64>>> {
        let shells = self.plan.radii.len();
        let (mut packed, mut blocks, mut block) = (Vec::<f32>::new(), Vec::new(), Vec::new());
        let (mut field, mut order) = (0, 0);
        for &(j, source) in requests {
            let (width, orders) = (j / 2 + 1, j.min(self.plan.resolution.l_max) + 1);
            let (field_size, order_size) = (width * self.inner.point_count, orders * self.crossing_count);
            if !block.is_empty() && (field + field_size > BLOCK_ELEMENTS || order + order_size > BLOCK_ELEMENTS) {
                blocks.push(std::mem::take(&mut block));
                (field, order) = (0, 0);
            }
            block.push(self.job(j, packed.len(), field, order));
            packed.extend(source.iter().map(|&v| v as f32));
            field += field_size;
            order += order_size;
        }
        blocks.push(block);
        self.sources_in[0].write(0, &packed);
        let bytes = (packed.len() * 4) as u64;
        let jobs: Vec<Buffer> =
            blocks.iter().map(|block| Buffer::upload(&self.gpu, "transport jobs", block)).collect::<Result<_>>()?;
        frames.run(|rec| {
            rec.pass("transport", |rec| {
                rec.copy_buffer(&self.sources_in[0], &self.sources_in[1], bytes);
                for (jobs, block) in jobs.iter().zip(&blocks) {
                    self.record_block(rec, jobs, block)?;
                }
                rec.copy_buffer(&self.sources_out[0], &self.sources_out[1], bytes);
                rec.make_visible_to_host(&self.sources_out[1]);
                Ok(())
            })
        })?;
        let result: Vec<f32> = self.sources_out[1].read(0, packed.len());
        let mut at = 0;
        Ok(requests
            .iter()
            .map(|(j, _)| {
                let length = self.plan.components(*j) * shells;
                at += length;
                result[at - length..at].iter().map(|&v| f64::from(v)).collect()
            })
            .collect())
    }

    fn record_rays(&self, rec: &mut Recorder<'_>, rays: &GpuRays, jobs: &Buffer, block: &[Job]) -> Result<()> {
        let count = block.len() as u32;
        let bindings = emit::Bindings {
            jobs,
            buckets: &rays.buckets,
            order: &rays.order,
            points: &rays.points,
            basis: &rays.basis,
            rotations: &self.rotations,
            sources: &self.sources_in[1],
            field: &self.field,
        };
        let push = [rays.point_count as u32, self.plan.radii.len() as u32, self.plan.resolution.l_max as u32];
        rec.dispatch(&self.pipelines.emit, &bindings, &push, [count * (BUCKET / EACH), rays.bucket_count as u32, 1])?;
        let bindings = sweep::Bindings { jobs, rays: &rays.rays, steps: &rays.steps, field: &self.field };
        let widest = block.iter().map(|job| job.j / 2 + 1).max().unwrap_or(1);
        let push = [rays.point_count as u32, rays.ray_count as u32];
        rec.dispatch(&self.pipelines.sweep, &bindings, &push, [rays.ray_count as u32 * widest, 1, count])
    }

    fn record_block(&self, rec: &mut Recorder<'_>, jobs: &Buffer, block: &[Job]) -> Result<()> {
        self.record_rays(rec, &self.inner, jobs, block)?;
        let count = block.len() as u32;
        let crossings = self.crossing_count as u32;
        let bindings = turn::Bindings {
            jobs,
            points: &self.inner.points,
            crossings: &self.crossings,
            rotations: &self.rotations,
            field: &self.field,
            orders: &self.orders,
        };
        let push = [self.inner.point_count as u32, crossings, self.plan.resolution.l_max as u32];
        rec.dispatch(&self.pipelines.turn, &bindings, &push, [crossings.div_ceil(EACH), 1, count])?;
        let bindings = project::Bindings {
            jobs,
            components: &self.components,
            ranges: &self.ranges,
            moments: &self.moments,
            projection: &self.projection,
            orders: &self.orders,
            sources: &self.sources_out[0],
        };
        let shells = self.plan.radii.len() as u32;
        let components = block.iter().map(|job| job.components).max().unwrap_or(1);
        let groups = (components * shells).div_ceil(GROUP);
        rec.dispatch(&self.pipelines.project, &bindings, &[shells, crossings], [count * GROUP, groups, 1])
    }

    /// Records the integration along the view rays, for all total angular momenta in order, into [`Self::field`].
    pub fn view(&self, rec: &mut Recorder<'_>, jobs: &Buffer, sources: usize) -> Result<()> {
        rec.copy_buffer(&self.sources_in[0], &self.sources_in[1], (sources * 4) as u64);
        let block: Vec<Job> = self.view_jobs();
        self.record_rays(rec, &self.outer, jobs, &block)
    }

    /// Packs the sources of all total angular momenta for [`Self::view`]; returns the buffer of jobs and their size.
    pub fn prepare_view(&self, sources: &[Vec<f64>]) -> Result<(Buffer, usize)> {
        let packed: Vec<f32> = sources.iter().flatten().map(|&v| v as f32).collect();
        self.sources_in[0].write(0, &packed);
        Ok((Buffer::upload(&self.gpu, "transport view jobs", &self.view_jobs())?, packed.len()))
    }

    fn view_jobs(&self) -> Vec<Job> {
        let (mut source, mut field) = (0, 0);
        (0..=self.plan.resolution.j_max)
            .map(|j| {
                let job = self.job(j, source, field, 0);
                source += self.plan.components(j) * self.plan.radii.len();
                field += (j / 2 + 1) * self.outer.point_count;
                job
            })
            .collect()
    }
}
