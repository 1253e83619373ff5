//! Pictures of the blend modes: whole frames of explicit particles, each pixel against the f64 model of its mode, and the
//! distance of that model from the exact integral.

use super::stack::settle;
use super::{Check, Group, Lab, Sabotage, Step, Verdict};
use crate::Result;
use crate::blend::supports;
use crate::frame::TableImages;
use crate::gpu::{Buffer, BufferKind, Image, ImageDesc};
use crate::params::{
    Aim, Blend, Camera, Clouds, Lighting, Params, ParticleDesc, Precision, Quality, Sky, SkyModel, Source, Style,
};
use crate::reference::scene::{Ellipsoid, ray};
use crate::reference::segments::{self, Composite, Segment};
use crate::renderer::Renderer;
use ash::vk;
use glam::DVec3;

/// The modes, the exact ones first.
const MODES: [Blend; 11] = [
    Blend::List,
    Blend::Tiled,
    Blend::Interlock(1),
    Blend::Interlock(2),
    Blend::Interlock(4),
    Blend::Interlock(8),
    Blend::Attachment(1),
    Blend::Attachment(2),
    Blend::Attachment(4),
    Blend::Attachment(8),
    Blend::Alpha,
];

/// What Welkin promises of f32 targets.
const PROMISED: f64 = 1e-4;

/// f32 places a ray to about this share of a particle's size. Where a thick particle is grazed, its chord is the square root
/// of what that disturbs: there a pixel may also differ by as much as particles smaller and larger by this share do.
const RAY_ROUNDING: f64 = 1e-6;

pub(super) fn add(list: &mut Vec<Check>) {
    for mode in MODES {
        let model = match mode {
            Blend::List | Blend::Tiled => "the exact f64 integral over all segments",
            Blend::Alpha => "the f64 model of sorted alpha",
            _ => "the f64 model of the same merge, in drawing order",
        };
        let what = format!(
            "frames of mode {mode} of three scenes (a heap of 40 ellipsoids; ellipsoids inside and across each other; the eye \
             inside one): every pixel within {PROMISED} of {model}"
        );
        let mut fails = vec![Sabotage::Expected, Sabotage::Lost];
        if matches!(mode, Blend::Interlock(1) | Blend::Attachment(1) | Blend::Alpha) {
            fails.push(Sabotage::Reversed); // wider windows mind the order less and less
        }
        let check = Check::new(Group::Images, mode.to_string().replace(':', "-"), what, move |lab| {
            if let Err(reason) = supports(mode, lab.gpu().capabilities()) {
                return Ok(Verdict::Skip(reason));
            }
            settle(agreement(lab, mode))
        });
        let why = "The same scene gives the same picture on every device, in every mode that it has";
        list.push(check.why(why).spec("Yusov 2014, 5.5; docs of welkin::blend").fails_by(fails));
    }
}

/// Scenes lie this far from each other [m]: multiples of the step of the floating origin, so that positions are exact in f32.
const APART: f64 = 20_480.0;

const NAMES: [&str; 3] = ["heap", "nested", "inside"];

/// The particles of all scenes, in their order.
fn particles() -> Vec<Vec<ParticleDesc>> {
    let ball = |centre: [f64; 3], radii: [f32; 3], density: f32, colour: [f32; 3]| ParticleDesc {
        centre,
        radii,
        density,
        colour,
        ..ParticleDesc::default()
    };
    let mut random = 5u32;
    let mut uniform = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 8) as f32 / (1 << 24) as f32
    };
    let heap = (0..40).map(|_| {
        let place = [0, 1, 2].map(|_| (f64::from(uniform()) * 150.0 * 64.0).floor() / 64.0 - 75.0);
        let q = [0, 1, 2, 3].map(|_| uniform() - 0.5);
        let length = q.iter().map(|c| c * c).sum::<f32>().sqrt();
        ParticleDesc {
            rotation: q.map(|c| c / length),
            ..ball(
                [place[0], place[1], place[2] - 220.0],
                [0, 1, 2].map(|_| 20.0 + 40.0 * uniform()),
                0.05 + 0.5 * uniform(),
                [0, 1, 2].map(|_| uniform()),
            )
        }
    });
    let nested = [
        ball([-30.0, 0.0, -150.0], [40.0, 30.0, 35.0], 0.5, [0.9, 0.2, 0.1]),
        ball([-30.0, 0.0, -152.0], [20.0, 15.0, 10.0], 0.8, [0.0, 1.0, 0.0]),
        ball([25.0, 5.0, -170.0], [45.0, 35.0, 50.0], 0.3, [0.1, 0.4, 0.8]),
        ball([10.0, 0.0, -120.0], [30.0, 10.0, 20.0], 0.2, [0.7, 0.7, 0.2]),
        ball([25.0, 5.0, -171.0], [5.0, 60.0, 5.0], 1.0, [1.0, 0.5, 0.25]),
    ];
    let inside = [
        ball([5.0, -3.0, 2.0], [60.0, 50.0, 70.0], 0.2, [0.7, 0.7, 0.2]),
        ball([50.0, 0.0, 0.0], [55.0, 20.0, 20.0], 0.3, [0.2, 0.9, 0.9]),
        ball([0.0, 0.0, 200.0], [30.0, 30.0, 30.0], 1.0, [1.0, 0.0, 0.0]),
        ball([0.0, 0.0, -180.0], [50.0, 50.0, 50.0], 0.5, [0.9, 0.3, 0.4]),
        ball([-20.0, 10.0, -60.0], [25.0, 15.0, 20.0], 0.4, [0.3, 0.3, 1.0]),
    ];
    let scenes = [heap.collect::<Vec<_>>(), nested.to_vec(), inside.to_vec()];
    (0u32..)
        .zip(scenes)
        .map(|(index, mut scene)| {
            scene.iter_mut().for_each(|particle| particle.centre[0] += APART * f64::from(index));
            scene
        })
        .collect()
}

fn camera(scene: usize) -> Camera {
    Camera { position: [APART * scene as f64, 0.0, 0.0], aim: Aim::Angles { yaw: 0.0, pitch: 0.0 }, fov_y: 60.0 }
}

/// What a ray holds: radiance and transmittance.
fn values(composite: Composite) -> [f64; 4] {
    let [r, g, b] = composite.radiance;
    [r, g, b, composite.transmittance]
}

/// Windows choose which of their segments to join. Where two choices are dearer than each other by less than this part, the
/// rounding of the ray (a few 1e-6 of a chord, more where it is short, summed over some ten terms) may tip them over: the
/// colour may then be that of either, and only the transmittance is compared.
const CLOSE_CALL: f64 = 1e-3;

/// At most this part of the pixels may be close calls.
const MOST_CLOSE: f64 = 0.05;

/// The model of `mode` of a ray's segments in drawing order, and whether it is a close call.
fn model(mode: Blend, back_to_front: &[Segment]) -> ([f64; 4], bool) {
    let composite = match mode {
        Blend::Alpha => segments::alpha(back_to_front),
        Blend::Interlock(1) | Blend::Attachment(1) => segments::merged(back_to_front),
        Blend::Interlock(k) | Blend::Attachment(k) => {
            let windowed = segments::window(k as usize, back_to_front);
            return (values(windowed.composite), windowed.margin < CLOSE_CALL);
        }
        _ => segments::exact(back_to_front),
    };
    (values(composite), false)
}

/// Every pixel of every scene; how far the model is from exact where the picture agrees with it.
fn agreement(lab: &mut Lab, mode: Blend) -> Step<String> {
    let extent: [u32; 2] = if lab.quick() { [48, 32] } else { [240, 160] };
    let scenes = particles();
    let mut drawn: Vec<ParticleDesc> = scenes.concat();
    if lab.sabotage() == Some(Sabotage::Lost) {
        drawn.remove(20);
    }
    let params = Params {
        clouds: Clouds {
            source: Source::Particles(drawn),
            lighting: Lighting::Flat,
            style: Style::Homogeneous,
            ..Clouds::default()
        },
        quality: Quality { downscale: 1, precision: Precision::F32, blend: mode, ..Quality::default() },
        sky: Sky { model: SkyModel::None, ..Sky::default() },
        ..Params::default()
    };
    let mut pictures = Pictures::new(lab, &params, extent)?;
    let (mut worst, mut squares, mut count, mut close_calls) = (0.0f64, 0.0, 0u32, 0u32);
    for (index, (scene, name)) in scenes.iter().zip(NAMES).enumerate() {
        let camera = camera(index);
        let eye = DVec3::from_array(camera.position);
        let mut ellipsoids: Vec<Ellipsoid> =
            scene.iter().map(|desc| Ellipsoid::of_desc(desc, params.clouds.sigma_t)).collect();
        ellipsoids.sort_by(|a, b| (b.centre - eye).length_squared().total_cmp(&(a.centre - eye).length_squared()));
        if lab.sabotage() == Some(Sabotage::Reversed) {
            ellipsoids.reverse();
        }
        let found = pictures.draw(lab, &camera)?;
        let perturbed = if lab.sabotage() == Some(Sabotage::Expected) { found.len() / 2 } else { usize::MAX };
        for (pixel, found) in found.iter().enumerate() {
            let (x, y) = (pixel as u32 % extent[0], pixel as u32 / extent[0]);
            let dir = ray(&camera, extent, extent, [x, y]);
            let cut = |scale: f64| -> Vec<Segment> {
                let scaled = |e: &Ellipsoid| Ellipsoid { semi_axes: e.semi_axes * scale, ..*e };
                ellipsoids.iter().filter_map(|e| scaled(e).segment(eye, dir, f64::INFINITY)).collect()
            };
            let ray = cut(1.0);
            let (mut expected, close) = model(mode, &ray);
            close_calls += u32::from(close);
            let compared = if close { 3..4 } else { 0..4 };
            if pixel == perturbed {
                expected[3] += 10.0 * PROMISED;
            }
            let errors: [f64; 4] = std::array::from_fn(|i| (f64::from(found[i]) - expected[i]).abs());
            if errors[compared.clone()].iter().any(|error| error.is_nan() || *error > PROMISED) {
                let ((a, _), (b, _)) = (model(mode, &cut(1.0 - RAY_ROUNDING)), model(mode, &cut(1.0 + RAY_ROUNDING)));
                let allowed: [f64; 4] = std::array::from_fn(|i| PROMISED + (a[i] - b[i]).abs());
                if compared.clone().any(|i| errors[i].is_nan() || errors[i] > allowed[i]) {
                    return Ok(Err(Verdict::fail(
                        format!("{expected:.6?} in scene {name} at ({x}, {y}), {} segments", ray.len()),
                        format!("{found:.6?}"),
                    )));
                }
            } else {
                worst = errors[compared].iter().fold(worst, |worst, error| worst.max(*error));
            }
            let exact = values(segments::exact(&ray));
            squares += (0..3).map(|i| (expected[i] - exact[i]).powi(2)).sum::<f64>() / 3.0;
            count += 1;
        }
    }
    if f64::from(close_calls) > MOST_CLOSE * f64::from(count) {
        return Ok(Err(Verdict::fail(
            format!("at most {:.0} % of the pixels to be close calls", 100.0 * MOST_CLOSE),
            format!("{close_calls} of {count}"),
        )));
    }
    let rms = (squares / f64::from(count)).sqrt();
    let close = if close_calls > 0 { format!(", {close_calls} of {count} pixels close calls") } else { String::new() };
    Ok(Ok(format!("largest difference {worst:.1e}{close}; the model's RMS error against exact {rms:.1e}")))
}

/// A renderer whose cloud targets are read back.
struct Pictures {
    renderer: Renderer,
    unused: Image,
    readback: Buffer,
    pixels: usize,
}

impl Pictures {
    fn new(lab: &mut Lab, params: &Params, extent: [u32; 2]) -> Result<Self> {
        let gpu = lab.gpu().clone();
        let pixels = (extent[0] * extent[1]) as usize;
        let unused = ImageDesc {
            name: "unused table",
            extent: [1, 1, 2],
            format: vk::Format::R16G16_SFLOAT,
            usage: vk::ImageUsageFlags::SAMPLED,
        };
        Ok(Self {
            renderer: Renderer::new(&gpu, params, extent, lab.frames().slots())?,
            unused: Image::new(&gpu, &unused)?,
            readback: Buffer::new(&gpu, "conform readback", 16 * pixels as u64, BufferKind::Readback)?,
            pixels,
        })
    }

    /// Radiance and transmittance of each pixel, once every list is long enough.
    fn draw(&mut self, lab: &mut Lab, camera: &Camera) -> Result<Vec<[f32; 4]>> {
        let gpu = lab.gpu().clone();
        loop {
            let tables = TableImages { optical_depth: &self.unused, scattering: &self.unused, fill: 1.0 };
            let slot = lab.submit(|rec| {
                self.renderer.record(rec, camera, tables)?;
                rec.copy_image_to_buffer(&self.renderer.targets().cloud, &self.readback);
                rec.make_visible_to_host(&self.readback);
                Ok(rec.slot())
            })?;
            if !self.renderer.finish(&gpu, slot)? {
                return Ok(self.readback.read(0, self.pixels));
            }
        }
    }
}
