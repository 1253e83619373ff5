//! Windows of several pending segments: the merges themselves on explicit rays, and the modes `interlock:K` and
//! `attachment:K` that keep them, against the f64 model of the same algorithm.

#[path = "support/blend.rs"]
mod support;

use ash::vk;
use std::sync::{Arc, Mutex};
use support::{Picture, Random, SIZE, ball, draw, open, segment};
use welkin::blend::{AUTO, NO_CLOUD, choose, supports};
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{
    BlendState, Buffer, BufferKind, ComputePipeline, Feature, FeedbackPath, GraphicsState, PipelineDesc,
    PipelineFactory, PipelineKind,
};
use welkin::params::{Blend, WINDOWS};
use welkin::reference::segments::{self, Composite, Segment, Windowed};
use welkin::shaders::probe_window_comp as probe;
use welkin::shared::Particle;

/// Segment of `glsl/blend/merge.glsl`, as it lies in a buffer.
type Packed = [f32; 8];

/// What the f64 model makes of segments: the paper's merge for K = 1.
fn model(k: u32, segments: &[Segment]) -> Windowed {
    match k {
        1 => Windowed { composite: segments::merged(segments), margin: 1.0 },
        k => segments::window(k as usize, segments),
    }
}

/// Choices between costs closer than this may fall otherwise in f32: a cost sums some ten terms of a segment that is itself
/// the outcome of some fifty merges, each rounded to 6e-8.
const CLOSE_CALL: f64 = 1e-4;

/// Where f32 and f64 choose alike they differ by rounding alone.
const F32: f64 = 1e-4;

/// Blends explicit rays, all of one length, on the device.
fn blend(device: &mut Standalone, k: u32, rays: &[Vec<Segment>]) -> Vec<[f32; 4]> {
    let gpu = device.gpu().clone();
    let length = rays[0].len();
    let pack = |s: &Segment| -> Packed {
        let [r, g, b] = s.colour.map(|c| c as f32);
        [r, g, b, s.optical_depth as f32, s.t_enter as f32, s.t_exit as f32, 0.0, 0.0]
    };
    let packed: Vec<Packed> = rays.iter().flatten().map(pack).collect();
    let input = Buffer::upload(&gpu, "rays", &packed).unwrap();
    let output = Buffer::array::<[f32; 4]>(&gpu, "composites", rays.len()).unwrap();
    let readback = Buffer::new(&gpu, "readback", output.size(), BufferKind::Readback).unwrap();
    let pipeline = ComputePipeline::new(&gpu, &probe::PROGRAM, &[("WINDOW", k)]).unwrap();
    device
        .frames()
        .run(|rec| {
            let bindings = probe::Bindings { rays: &input, composites: &output };
            let count = rays.len() as u32;
            rec.dispatch(&pipeline, &bindings, &[count, length as u32], [count, 1, 1])?;
            rec.copy_buffer(&output, &readback, output.size());
            rec.make_visible_to_host(&readback);
            Ok(())
        })
        .unwrap();
    device.frames().state().forget();
    if let Some(messages) = device.messages() {
        assert_eq!(messages.all(), Vec::<String>::new());
    }
    readback.read(0, rays.len())
}

fn distance(got: [f32; 4], expected: Composite) -> f64 {
    let radiance = (0..3).map(|i| (f64::from(got[i]) - expected.radiance[i]).abs());
    radiance.fold((f64::from(got[3]) - expected.transmittance).abs(), f64::max)
}

/// Numbers that f32 holds too: both sides then start from the same segments.
fn held(s: Segment) -> Segment {
    let f = |x: f64| f64::from(x as f32);
    Segment { colour: s.colour.map(f), optical_depth: f(s.optical_depth), t_enter: f(s.t_enter), t_exit: f(s.t_exit) }
}

/// 16 segments on a ray of which about 6 overlap anywhere, back to front by centre.
fn ray(random: &mut Random, tau: f64) -> Vec<Segment> {
    let mut r = || f64::from(random.next());
    let mut one = |_| {
        let (centre, half) = (4.0 * r(), 0.5 + 0.5 * r());
        let colour = [r(), r(), r()];
        held(Segment { colour, optical_depth: tau * (0.2 + 1.6 * r()), t_enter: centre - half, t_exit: centre + half })
    };
    let mut ray: Vec<Segment> = (0..16).map(&mut one).collect();
    ray.sort_by(|a, b| (b.t_enter + b.t_exit).total_cmp(&(a.t_enter + a.t_exit)));
    ray
}

fn shuffle(random: &mut Random, ray: &mut [Segment]) {
    for i in (1..ray.len()).rev() {
        ray.swap(i, (random.next() * (i + 1) as f32) as usize);
    }
}

/// Rays that try every way in which segments can lie to each other, far off and close by.
fn odd_rays(random: &mut Random) -> Vec<Vec<Segment>> {
    let mut rays = Vec::new();
    for i in 0..400 {
        let tau = [1e-7, 1e-3, 0.5, 2.0, 60.0][i % 5];
        let mut ray = ray(random, tau);
        match i % 8 {
            0 => shuffle(random, &mut ray),
            // One inside the other.
            1 => (0..8).for_each(|j| ray[2 * j] = Segment { t_enter: -1.0, t_exit: 6.0, ..ray[2 * j] }),
            // Equal entries, equal exits, equal segments.
            2 => (0..8).for_each(|j| ray[2 * j].t_enter = ray[2 * j + 1].t_enter),
            3 => (0..8).for_each(|j| ray[2 * j].t_exit = ray[2 * j + 1].t_exit),
            4 => (0..8).for_each(|j| {
                let Segment { t_enter, t_exit, .. } = ray[2 * j + 1];
                ray[2 * j] = Segment { t_enter, t_exit, ..ray[2 * j] };
            }),
            // Optical depths from next to nothing to opaque in one ray.
            5 => ray.iter_mut().for_each(|s| s.optical_depth *= 10f64.powf(8.0 * f64::from(random.next()) - 6.0)),
            // Gaps between all.
            6 => ray.iter_mut().enumerate().for_each(|(j, s)| {
                (s.t_enter, s.t_exit) = (100.0 - 3.0 * j as f64, 102.0 - 3.0 * j as f64);
            }),
            _ => {}
        }
        // The eye is at 0, and inside some.
        for s in &mut ray {
            s.t_enter = (s.t_enter + 0.3).max(0.0);
            s.t_exit = (s.t_exit + 0.3).max(s.t_enter + 0.01);
        }
        // Some kilometres away, in metres.
        if i % 3 == 0 {
            ray.iter_mut().for_each(|s| (s.t_enter, s.t_exit) = (2e4 + 100.0 * s.t_enter, 2e4 + 100.0 * s.t_exit));
        }
        rays.push(ray.into_iter().map(held).collect());
    }
    rays
}

/// Asserts that `got` is what the model of window `k` makes of each ray, but for close calls, of which there are few.
fn assert_follows(name: &str, k: u32, rays: &[Vec<Segment>], got: &[[f32; 4]]) {
    let (mut worst, mut close, mut changed) = (0.0f64, 0, 0);
    for (ray, got) in rays.iter().zip(got) {
        let Windowed { composite, margin } = model(k, ray);
        let error = distance(*got, composite);
        if margin < CLOSE_CALL {
            close += 1;
            changed += usize::from(error > F32);
            assert!((f64::from(got[3]) - composite.transmittance).abs() < F32);
        } else {
            worst = worst.max(error);
        }
    }
    println!(
        "{name}: {worst:.1e} from the model; {close} of {} rays close calls, {changed} decided otherwise",
        rays.len()
    );
    assert!(worst < F32, "{name}: {worst}");
    assert!(20 * close <= rays.len(), "{name}: {close} of {} rays are close calls", rays.len());
}

#[test]
fn every_window_follows_its_model_on_explicit_rays() {
    let mut device = open(true);
    let mut random = Random(11);
    let odd = odd_rays(&mut random);
    for k in WINDOWS {
        let got = blend(&mut device, k, &odd);
        assert_follows(&format!("K = {k}, odd rays"), k, &odd, &got);
    }
}

#[test]
fn the_error_falls_with_the_window_as_expected() {
    // The expected curve, for alpha blending and K = 1, 2, 4, 8, was measured with windows that always commit the farthest.
    // Windows must be within 20 % of it, or better.
    let mut device = open(true);
    for (tau, expected) in [(0.5, [0.041, 0.031, 0.014, 0.0012]), (2.0, [0.077, 0.051, 0.012, 0.0002])] {
        let mut random = Random(5);
        let rays: Vec<_> = (0..1000).map(|_| ray(&mut random, tau)).collect();
        for (k, expected) in WINDOWS.into_iter().zip(expected) {
            let got = blend(&mut device, k, &rays);
            assert_follows(&format!("K = {k}, tau = {tau}"), k, &rays, &got);
            let square = |(ray, got): (&Vec<Segment>, &[f32; 4])| {
                let exact = segments::exact(ray);
                (0..3).map(|i| (f64::from(got[i]) - exact.radiance[i]).powi(2)).sum::<f64>()
            };
            let rms = (rays.iter().zip(&got).map(square).sum::<f64>() / (3 * rays.len()) as f64).sqrt();
            println!("K = {k}, tau = {tau}: RMS error {rms:.6}, expected at most {expected}");
            assert!(rms < 1.2 * expected, "K = {k}, tau = {tau}: {rms}");
            assert!(k > 1 || rms > 0.8 * expected, "the paper's merge leaves no freedom: {rms}");
        }
    }
}

#[test]
fn transmittance_is_that_of_the_sum_of_optical_depths_in_any_order() {
    let mut device = open(true);
    let mut random = Random(23);
    let mut rays: Vec<_> = (0..200).map(|_| ray(&mut random, 0.2)).collect();
    for order in 0..3 {
        for k in WINDOWS {
            for (ray, got) in rays.iter().zip(blend(&mut device, k, &rays)) {
                let exact = (-ray.iter().map(|s| s.optical_depth).sum::<f64>()).exp();
                // Sixteen f32 additions, and an exponential of a few units in the last place.
                assert!((f64::from(got[3]) - exact).abs() < 2e-6, "K = {k}, order {order}: {} {exact}", got[3]);
            }
        }
        rays.iter_mut().for_each(|ray| shuffle(&mut random, ray));
    }
}

/// Collects the description of every pipeline built.
#[derive(Clone, Default)]
struct Descriptions(Arc<Mutex<Vec<PipelineDesc>>>);

impl PipelineFactory for Descriptions {
    fn describe(&self, desc: PipelineDesc) -> PipelineDesc {
        self.0.lock().unwrap().push(desc.clone());
        desc
    }
}

impl Descriptions {
    /// The last graphics pipeline.
    fn graphics(&self) -> PipelineDesc {
        let built = self.0.lock().unwrap();
        built.iter().rfind(|desc| matches!(desc.kind, PipelineKind::Graphics(_))).unwrap().clone()
    }
}

/// Every way in which this driver can keep a window of `k`: a name, a device that does it so and what it builds, the mode.
fn ways(k: u32) -> Vec<(String, (Standalone, Descriptions), Blend)> {
    let open = |mode: Blend, without: Vec<Feature>, path: Option<FeedbackPath>| {
        let built = Descriptions::default();
        let factory = Some(Box::new(built.clone()) as Box<dyn PipelineFactory>);
        let device = Standalone::new(Options { validation: true, without, factory, ..Options::default() }).unwrap();
        if let Err(reason) = supports(mode, device.gpu().capabilities()) {
            println!("{mode} not proved here: {reason}");
            return None;
        }
        let particle = ball([0.0, 0.0, -100.0], [10.0; 3], 0.1, [1.0; 3]);
        let mut device = device;
        draw(&mut device, mode, &[particle], NO_CLOUD);
        let used = match built.graphics().kind {
            PipelineKind::Graphics(state) => state.feedback.map(|feedback| feedback.path),
            PipelineKind::Compute => None,
        };
        (used == path).then(|| (format!("{mode} by {path:?}"), (device, built), mode))
    };
    let without = vec![Feature::DynamicRenderingLocalRead];
    let ways = [
        open(Blend::Interlock(k), vec![], None),
        open(Blend::Attachment(k), vec![], Some(FeedbackPath::LocalRead)),
        open(Blend::Attachment(k), without, Some(FeedbackPath::Subpass)),
    ];
    ways.into_iter().flatten().collect()
}

#[test]
fn every_way_to_keep_a_window_gives_what_its_model_gives() {
    let mut random = Random(7);
    let heaps = [3, 12, 40].map(|count| {
        let mut heap: Vec<Particle> = (0..count).map(|_| random.particle(220.0, 150.0)).collect();
        // By distance of the centre, as the renderer draws them; the last heap is left in disorder.
        let far = |p: &Particle| p.centre.iter().map(|c| c * c).sum::<f32>();
        if count < 40 {
            heap.sort_by(|a, b| far(b).total_cmp(&far(a)));
        }
        heap
    });
    let around = ball([5.0, -3.0, 2.0], [60.0, 50.0, 70.0], 0.4, [0.7, 0.7, 0.2]);
    let cut = ball([50.0, 0.0, 0.0], [55.0, 20.0, 20.0], 0.3, [0.2, 0.9, 0.9]);
    let far = ball([0.0, 0.0, -180.0], [50.0, 50.0, 50.0], 0.5, [0.9, 0.3, 0.4]);
    let near = ball([10.0, 0.0, -150.0], [70.0, 30.0, 60.0], 0.2, [0.1, 0.3, 0.8]);
    let eye_inside = vec![far, near, cut, around];
    let [few, more, disorder] = heaps;
    let scenes = [(few, NO_CLOUD), (more, NO_CLOUD), (disorder, NO_CLOUD), (eye_inside, 160.0)];
    // What pixel each ray belongs to, and the ray.
    let rays = scenes.each_ref().map(|(particles, opaque)| {
        let pixels = (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y)));
        let ray = |(x, y)| particles.iter().filter_map(|p| segment(p, x, y, f64::from(*opaque))).collect();
        let rays = pixels.map(|(x, y)| ((y * SIZE + x) as usize, ray((x, y))));
        rays.filter(|(_, ray): &(usize, Vec<Segment>)| !ray.is_empty()).unzip::<usize, _, Vec<_>, Vec<_>>()
    });
    for k in WINDOWS {
        let mut first: Option<(Blend, Vec<Picture>)> = None;
        for (name, (mut device, _), mode) in ways(k) {
            let mut draw = |(particles, opaque): &(Vec<Particle>, f32)| draw(&mut device, mode, particles, *opaque);
            let pictures: Vec<Picture> = scenes.iter().map(&mut draw).collect();
            for (scene, picture) in scenes.iter().zip(&pictures).take(2) {
                assert!(draw(scene) == *picture, "{name}: another run, other bits");
            }
            // Both ways of `attachment` run one and the same shader.
            let expected = first.as_ref().filter(|(first, _)| *first == mode).map(|(_, pictures)| pictures);
            if let Some(expected) = expected {
                assert!(pictures == *expected, "{name} differs from the other way");
            } else {
                for (picture, (pixels, rays)) in pictures.iter().zip(&rays) {
                    let got: Vec<_> = pixels.iter().map(|pixel| picture.cloud[*pixel]).collect();
                    assert_follows(&name, k, rays, &got);
                    for (pixel, ray) in pixels.iter().zip(rays) {
                        let nearest = ray.iter().map(|s| s.t_enter).fold(f64::from(NO_CLOUD), f64::min);
                        let got = f64::from(picture.nearest[*pixel]);
                        assert!((got - nearest).abs() <= 1e-3 * nearest.max(1.0), "{name}: nearest {got} {nearest}");
                    }
                }
                first = Some((mode, pictures));
            }
        }
    }
}

/// Whether a pipeline asks that its fragments read and write every attachment in turn, or what is wrong.
fn ordered_feedback(desc: &PipelineDesc) -> Result<(), String> {
    let PipelineKind::Graphics(state) = &desc.kind else { return Err("not a graphics pipeline".into()) };
    let feedback = state.feedback.ok_or("fragments do not read what they write")?;
    let subpass = vk::SubpassDescriptionFlags::RASTERIZATION_ORDER_ATTACHMENT_COLOR_ACCESS_EXT;
    let blend = vk::PipelineColorBlendStateCreateFlags::RASTERIZATION_ORDER_ATTACHMENT_ACCESS_EXT;
    if !feedback.subpass_flags().contains(subpass) || !feedback.blend_flags().contains(blend) {
        return Err("order is not asked for".into());
    }
    let inputs: Vec<u32> = desc.program.bindings.iter().filter_map(|binding| binding.attachment).collect();
    if inputs != (0..state.attachments.len() as u32).collect::<Vec<_>>() {
        return Err(format!("attachments {inputs:?} of {} are read", state.attachments.len()));
    }
    if state.attachments.iter().any(|attachment| !matches!(attachment.blend, BlendState::Replace)) {
        return Err("fixed-function blending changes what a fragment writes".into());
    }
    Ok(())
}

#[test]
fn attachment_pipelines_ask_for_order_and_one_that_does_not_is_seen() {
    // A software rasterizer keeps a pixel's fragments in order even where nobody asks: no picture shows a missing flag.
    for k in WINDOWS {
        for (name, (_device, built), mode) in ways(k) {
            if matches!(mode, Blend::Interlock(_)) {
                continue;
            }
            let good = built.graphics();
            assert_eq!(ordered_feedback(&good), Ok(()), "{name}");
            let broken = |change: &dyn Fn(&mut GraphicsState)| {
                let mut desc = good.clone();
                if let PipelineKind::Graphics(state) = &mut desc.kind {
                    change(state);
                }
                ordered_feedback(&desc).unwrap_err()
            };
            assert!(broken(&|state| state.feedback = None).contains("do not read"));
            assert!(broken(&|state| state.feedback.as_mut().unwrap().ordered = false).contains("order is not"));
            assert!(broken(&|state| state.attachments.truncate(2)).contains("are read"));
            assert!(broken(&|state| state.attachments[1].blend = BlendState::Min).contains("blending"));
        }
    }
}

#[test]
fn auto_takes_attachments_where_there_is_no_interlock_and_a_window_too_wide_is_refused_with_the_reason() {
    let without = vec![Feature::FragmentShaderInterlock];
    let device = Standalone::new(Options { without, ..Options::default() }).unwrap();
    let capabilities = device.gpu().capabilities();
    let choice = choose(Blend::Auto, capabilities).unwrap();
    let best = AUTO.iter().find(|mode| supports(**mode, capabilities).is_ok()).unwrap();
    assert_eq!(choice.used, *best);
    assert!(choice.reason.contains("no interlock"), "{}", choice.reason);
    match capabilities.supports(Feature::RasterizationOrderAttachmentAccess) {
        Ok(()) => {
            assert!(matches!(choice.used, Blend::Attachment(_)));
            let reason = supports(Blend::Attachment(8), capabilities).unwrap_err();
            assert!(reason.contains("13 attachments"), "{reason}");
        }
        Err(reason) => println!("attachment not proved here: {reason}"),
    }
    for mode in [Blend::Interlock(3), Blend::Attachment(0)] {
        assert!(supports(mode, capabilities).unwrap_err().contains("[1, 2, 4, 8]"));
    }
}
