//! What a and b are measured against.

use std::ops::ControlFlow;

use welkin::blend::EXACT;
use welkin::compare::{Reference, oracle};
use welkin::output::{BlendStats, Picture};
use welkin::params::{Blend, Params};
use welkin::pathtrace::{PathOptions, PathTracer};
use welkin::{Error, Result};

use super::super::args::{AbArgs, ReferenceArg, Size};
use super::super::progress::Progress;
use super::super::scenes;
use super::super::session::{Device, Session};

/// Samples a pixel of a path-traced reference, if not said otherwise.
const DEFAULT_SPP: u32 = 256;

/// Makes references.
pub struct Judge {
    by: By,
    size: Size,
    choice: BlendStats,
}

enum By {
    Mode(Box<Session>),
    Oracle,
    Path { spp: u32 },
}

impl Judge {
    /// The reference that was asked for; `compared` are the modes that are measured against it.
    pub fn open(args: &AbArgs, device: &mut Device, params: &Params, compared: [&str; 2]) -> Result<Self> {
        let mode = |device: &mut Device, mode| {
            let params = scenes::blended(params.clone(), Some(mode), "--reference")?;
            Session::open(device, &params, &args.picture).map(Box::new)
        };
        let (by, used, reason) = match args.reference {
            ReferenceArg::Mode(blend) => {
                let session = mode(device, blend)?;
                let blend = session.blend();
                (By::Mode(session), blend.used, blend.reason)
            }
            ReferenceArg::Exact => {
                let (blend, why) = exact(device, compared)?;
                (By::Mode(mode(device, blend)?), blend.to_string(), why)
            }
            ReferenceArg::Oracle => (By::Oracle, "oracle".into(), "exact integration in f64".into()),
            ReferenceArg::Path => {
                let spp = args.spp.unwrap_or(DEFAULT_SPP);
                (By::Path { spp }, "path".into(), format!("{spp} paths a pixel"))
            }
        };
        let choice = BlendStats { requested: args.reference.to_string(), used, reason };
        Ok(Self { by, size: args.picture.size, choice })
    }

    /// What was asked for, what is used, and why.
    pub fn choice(&self) -> &BlendStats {
        &self.choice
    }

    /// The reference of a frame, whose parameters are given.
    pub fn frame(&mut self, device: &mut Device, params: &Params, frame: u32) -> Result<Reference> {
        let size = [self.size.width, self.size.height];
        match &mut self.by {
            By::Mode(session) => Ok(session.frame(device, params)?.picture.into()),
            By::Oracle => oracle(params, size).map(Reference::from),
            By::Path { spp } => trace(device, params, size, *spp, frame),
        }
    }
}

/// A path-traced frame. Each frame has a seed of its own, so that the noise of two frames is independent.
pub fn trace(device: &mut Device, params: &Params, size: [u32; 2], spp: u32, frame: u32) -> Result<Reference> {
    let options = PathOptions { seed: frame, ..PathOptions::default() };
    let mut tracer = PathTracer::new(device.frames(), params, size, &options)?;
    let mut bar = Progress::start(format!("paths of frame {frame}"), u64::from(spp));
    let _ = tracer.run(device.frames(), spp, &mut |progress| {
        bar.set(u64::from(progress.samples));
        ControlFlow::Continue(())
    })?;
    let truth = tracer.develop(device.frames())?;
    let picture = Picture {
        width: size[0],
        height: size[1],
        radiance: truth.radiance,
        transmittance: Some(truth.transmittance),
        display: truth.display,
    };
    Ok(Reference { picture, variance: Some(truth.variance) })
}

/// An exact mode that the device has, and why that one.
fn exact(device: &Device, compared: [&str; 2]) -> Result<(Blend, String)> {
    let modes: Vec<_> = EXACT.iter().map(|&mode| (mode, device.supports(mode))).collect();
    let usable = || modes.iter().filter(|(_, answer)| answer.is_ok()).map(|(mode, _)| *mode);
    // A mode should not be its own judge.
    let other = usable().find(|mode| !compared.contains(&mode.to_string().as_str()));
    match other.map(|mode| (mode, "exact, and neither a nor b")).or(usable().next().map(|mode| (mode, "exact"))) {
        Some((mode, why)) => Ok((mode, why.into())),
        None => {
            let reasons = modes.iter().filter_map(|(mode, answer)| Some(format!("{mode}: {}", answer.as_ref().err()?)));
            let reasons: Vec<_> = reasons.collect();
            let needed = format!("--reference exact ({})", reasons.join("; "));
            Err(Error::Unsupported { needed, by: device.stats().name })
        }
    }
}
