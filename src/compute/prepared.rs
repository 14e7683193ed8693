//! A pass that was recorded and can run, and where its results are.

use super::{
    attach::{Attachment, Attachments},
    target::Target,
};
use crate::{
    error::{Error, Result},
    image::{Extent, Picture},
    pass::Frame,
    vk::{Buffer, Gpu, Recording, Timings, error::no_memory},
};
use bytemuck::Pod;

/// A pass that was recorded and can run.
///
/// Each band is a submission of its own, so that the time-out is for one band, whatever
/// the size of the target.
pub struct Prepared {
    recordings: Vec<Recording>,
    /// Copy the targets to the host, if the host does not see the device's memory. They are not part of the
    /// recordings, so that the time of a frame does not include them.
    color_copies: Vec<Recording>,
    depth_copies: Vec<Recording>,
    results: Results,
}

impl Prepared {
    pub(super) fn new(gpu: &Gpu, recordings: Vec<Recording>, results: Results) -> Result<Self> {
        let (mut color_copies, mut depth_copies) = (Vec::new(), Vec::new());
        for target in &results.targets {
            color_copies.extend(target.copy_of_color(gpu)?);
            depth_copies.extend(target.copy_of_depth(gpu)?);
        }
        Ok(Self { recordings, color_copies, depth_copies, results })
    }

    /// Runs the pass on the device and waits.
    ///
    /// # Errors
    /// [`crate::Error::Lost`] if the device does not answer in time.
    pub fn execute(&mut self) -> Result<Timings> {
        let mut all = Timings::default();
        for recording in &mut self.recordings {
            let band = recording.run()?;
            all.total_ns += band.total_ns;
            all.stages.extend(band.stages);
        }
        Ok(all)
    }

    /// The targets after the last [`Prepared::execute`]; before the first, they hold anything. Of a target that is an image,
    /// what the image holds now.
    ///
    /// # Errors
    /// As [`Prepared::execute`].
    pub fn read(&mut self) -> Result<Frame> {
        for copy in self.color_copies.iter_mut().chain(&mut self.depth_copies) {
            copy.run()?;
        }
        self.results.read()
    }

    /// The colour target alone, as [`Prepared::read`] returns it: half the work, if depth is not needed.
    ///
    /// # Errors
    /// As [`Prepared::execute`], and [`Error::Usage`] if the pass stores no colour.
    pub fn read_color(&mut self) -> Result<Picture> {
        for copy in &mut self.color_copies {
            copy.run()?;
        }
        let color = self.results.color()?;
        color.ok_or_else(|| Error::Usage("the pass stores no colour target".into()))
    }
}

/// Where the results of a pass are.
pub struct Results {
    pub extent: Extent,
    pub attachments: Attachments,
    /// The rows of each band.
    pub targets: Vec<Target>,
}

impl Results {
    /// All of them.
    pub fn read(&self) -> Result<Frame> {
        Ok(Frame { colors: self.color()?.into_iter().collect(), depth: self.depth()? })
    }

    /// Colour, if it is stored.
    fn color(&self) -> Result<Option<Picture>> {
        self.of(self.attachments.color.as_ref(), |target| target.host_color.as_ref())
    }

    /// Depth, if it is stored.
    fn depth(&self) -> Result<Option<Picture>> {
        self.of(self.attachments.depth.as_ref(), |target| target.host_depth.as_ref())
    }

    /// The picture of `attachment`, the rows of whose bands are where `rows` says, unless it is an image.
    fn of<A: Copy, T: Pod>(
        &self,
        attachment: Option<&Attachment<A>>,
        rows: impl Fn(&Target) -> Option<&Buffer<T>>,
    ) -> Result<Option<Picture>> {
        let Some(attachment) = attachment.filter(|attachment| attachment.is_stored()) else {
            return Ok(None);
        };
        if let Some(image) = &attachment.image {
            let at = attachment.subresource;
            return image.download_layer(at.level, at.layer).map(Some);
        }
        let (extent, format) = (self.extent, attachment.format);
        let (mut bytes, wanted) = (Vec::new(), extent.pixels() * format.texel_bytes());
        bytes.try_reserve_exact(wanted).map_err(|_| no_memory("the picture", wanted as u64))?;
        for rows in self.targets.iter().filter_map(rows) {
            rows.cast()?.append_to(&mut bytes)?;
        }
        Ok(Some(Picture { extent, format, bytes }))
    }
}
