//! Where Welkin's commands meet those of a host: images that are lent, shared and given back.

use super::Recorder;
use super::barriers::ALL;
use crate::gpu::{Access, Image};
use ash::vk;

impl Recorder<'_> {
    /// Makes what Welkin has written to an image of its own visible to the host's next commands of kind `access`, in this
    /// or a later command buffer of the queue. The image stays in `GENERAL` layout; later passes wait for that access.
    pub fn share(&mut self, image: &Image, access: Access) {
        self.initialise(image);
        self.transition("share", &[(image.id, access)]);
    }

    /// Takes over a lent image that was last used as `access` in `layout`; its contents are kept unless the layout is
    /// `UNDEFINED`. Every lent image is acquired before a pass uses it and released afterwards, in every frame anew.
    pub fn acquire(&mut self, image: &Image, access: Access, layout: vk::ImageLayout) {
        let (src_stage, src_access) = access.masks();
        self.layout(image, (src_stage, src_access), ALL, layout, vk::ImageLayout::GENERAL);
        self.state.tracked.set_initialised(image.id, true);
        self.state.tracked.reset(image.id);
    }

    /// Gives a lent image back, ready for `access` in `layout`.
    pub fn release(&mut self, image: &Image, access: Access, layout: vk::ImageLayout) {
        self.layout(image, ALL, access.masks(), vk::ImageLayout::GENERAL, layout);
        self.state.tracked.set_initialised(image.id, false);
        self.state.tracked.reset(image.id);
    }
}
