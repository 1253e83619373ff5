//! The exact picture of a scene that has a closed form, without a device.

use crate::film::gain;
use crate::output::Picture;
use crate::params::{Film, Params, SkyModel, ToneCurve};
use crate::reference::film::{filmic, srgb_encode};
use crate::reference::scene::Scene;
use crate::{Error, Result};

/// What a perfect blend mode makes of `params` at `size` pixels, integrated in f64 for every pixel
/// ([`reference::scene`](crate::reference::scene)).
///
/// # Errors
/// [`Error::Unsupported`] for a scene other than explicit particles of homogeneous style under flat lighting, before black.
pub fn oracle(params: &Params, size: [u32; 2]) -> Result<Picture> {
    if params.sky.model != SkyModel::None {
        return Err(Error::Unsupported {
            needed: "a sky model other than \"none\"".into(),
            by: "the exact oracle".into(),
        });
    }
    let pixels = Scene::new(&params.clouds)?.targets(&params.camera, size, size);
    let radiance: Vec<[f64; 3]> = pixels.iter().map(|pixel| pixel.radiance).collect();
    Ok(Picture {
        width: size[0],
        height: size[1],
        display: radiance.iter().map(|radiance| shown(*radiance, &params.film)).collect(),
        radiance: radiance.iter().map(|radiance| radiance.map(|v| v as f32)).collect(),
        transmittance: Some(pixels.iter().map(|pixel| pixel.transmittance as f32).collect()),
    })
}

/// Exposure, tone curve and sRGB encoding, as `glsl/film/tonemap.glsl`.
fn shown(radiance: [f64; 3], film: &Film) -> [f32; 3] {
    let gain = gain(film, SkyModel::None);
    std::array::from_fn(|c| {
        let value = (radiance[c] * f64::from(gain[c])).max(0.0);
        let toned = match film.curve {
            ToneCurve::Filmic => filmic(value),
            ToneCurve::Linear => value.min(1.0),
        };
        srgb_encode(toned) as f32
    })
}
