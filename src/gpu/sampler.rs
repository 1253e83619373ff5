//! Samplers.

use ash::vk;

/// The samplers that Welkin uses.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Sampler {
    /// Nearest texel, clamped.
    NearestClamp,
    /// (Tri)linear, clamped.
    LinearClamp,
    /// (Tri)linear, repeating in every direction.
    LinearRepeat,
    /// Trilinear, repeating in x and z, clamped in y: the optical depth table, whose azimuths wrap.
    LinearRepeatClampRepeat,
}

impl Sampler {
    pub(crate) const ALL: [Self; 4] =
        [Self::NearestClamp, Self::LinearClamp, Self::LinearRepeat, Self::LinearRepeatClampRepeat];

    pub(crate) fn info(self) -> vk::SamplerCreateInfo<'static> {
        let filter = if self == Self::NearestClamp { vk::Filter::NEAREST } else { vk::Filter::LINEAR };
        let (clamp, repeat) = (vk::SamplerAddressMode::CLAMP_TO_EDGE, vk::SamplerAddressMode::REPEAT);
        let [u, v, w] = match self {
            Self::NearestClamp | Self::LinearClamp => [clamp; 3],
            Self::LinearRepeat => [repeat; 3],
            Self::LinearRepeatClampRepeat => [repeat, clamp, repeat],
        };
        vk::SamplerCreateInfo::default()
            .mag_filter(filter)
            .min_filter(filter)
            .address_mode_u(u)
            .address_mode_v(v)
            .address_mode_w(w)
    }
}
