//! A pass that was recorded and can run, and where its results are.

use super::{
    attach::{Attachment, Attachments},
    narrow,
    target::Target,
};
use crate::{
    error::{Error, Result},
    grid::Grid,
    image::{Extent, Picture},
    pass::Frame,
    vk::{Buffer, Gpu, Recording, Timings, error::no_memory},
};

/// A pass that was recorded and can run.
///
/// Each band is a submission of its own, so that the time-out is for one band, whatever
/// the size of the target.
pub struct Prepared {
    recordings: Vec<Recording>,
    /// Copy the targets to the host, if the host does not see the device's memory. They are not part of the
    /// recordings, so that the time of a frame does not include them.
    color_copies: Vec<Recording>,
    other_copies: Vec<Recording>,
    results: Results,
}

impl Prepared {
    pub(super) fn new(gpu: &Gpu, recordings: Vec<Recording>, results: Results) -> Result<Self> {
        let (mut color_copies, mut other_copies) = (Vec::new(), Vec::new());
        for target in &results.targets {
            color_copies.extend(target.copy_of_color(gpu)?);
            other_copies.extend(target.copy_of_depth(gpu)?);
            other_copies.extend(target.copy_of_stencil(gpu)?);
        }
        Ok(Self { recordings, color_copies, other_copies, results })
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
        for copy in self.color_copies.iter_mut().chain(&mut self.other_copies) {
            copy.run()?;
        }
        self.results.read()
    }

    /// The first colour target that is stored, as [`Prepared::read`] returns it: half the work, if depth is not needed.
    ///
    /// # Errors
    /// As [`Prepared::execute`], and [`Error::Usage`] if the pass stores no colour.
    pub fn read_color(&mut self) -> Result<Picture> {
        for copy in &mut self.color_copies {
            copy.run()?;
        }
        let color = self.results.colors().next();
        color.transpose()?.ok_or_else(|| Error::Usage("the pass stores no colour target".into()))
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
        let (colors, depth) = (self.colors().collect::<Result<_>>()?, self.depth()?);
        Ok(Frame { colors, depth, stencil: self.stencil()? })
    }

    /// The colour targets that are stored, in their order.
    fn colors(&self) -> impl Iterator<Item = Result<Picture>> {
        let stored = self.attachments.colors().enumerate().filter(|(_, color)| color.is_stored());
        stored.map(|(number, color)| {
            self.of(color, |target, band| {
                let (_, bytes) = self.attachments.planes(band).nth(number)?;
                Some(target.host_color.as_ref()?.cast().and_then(|rows| rows.slice(bytes)))
            })
        })
    }

    /// Depth, if it is stored.
    fn depth(&self) -> Result<Option<Picture>> {
        let depth = self.attachments.depth.as_ref().filter(|depth| depth.is_stored());
        let rows = |target: &Target, _: &Grid| Some(target.host_depth.as_ref()?.cast());
        depth.map(|depth| self.of(depth, rows)).transpose()
    }

    /// Stencil values, if they are stored.
    fn stencil(&self) -> Result<Option<Picture>> {
        let stencil = self.attachments.stencil.as_ref().filter(|stencil| stencil.is_stored());
        let rows = |target: &Target, _: &Grid| Some(target.host_stencil.as_ref()?.cast());
        stencil.map(|stencil| self.of(stencil, rows)).transpose()
    }

    /// The picture of `attachment`, which is stored. The rows of its bands are where `rows` says, unless it is an image.
    fn of<A: Copy>(
        &self,
        attachment: &Attachment<A>,
        rows: impl Fn(&Target, &Grid) -> Option<Result<Buffer<u8>>>,
    ) -> Result<Picture> {
        if let Some(image) = &attachment.image {
            return image.download_subresource(attachment.subresource);
        }
        let (extent, format) = (self.extent, attachment.format);
        let (mut bytes, wanted) = (Vec::new(), extent.pixels() * format.texel_bytes());
        bytes.try_reserve_exact(wanted).map_err(|_| no_memory("the picture", wanted as u64))?;
        let bands = Grid::bands(extent, self.attachments.row_bytes(), self.attachments.samples);
        for rows in self.targets.iter().zip(bands).filter_map(|(target, band)| rows(target, &band))
        {
            match narrow::is_narrow(format) {
                true => narrow::append(format, &rows?.cast()?.read()?, &mut bytes),
                false => rows?.append_to(&mut bytes)?,
            }
        }
        Ok(Picture { extent, format, bytes })
    }
}
