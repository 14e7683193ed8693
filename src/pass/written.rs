//! The buffers that the shaders of a pass write.

use super::{Binding, BufferSource, Pass};
use std::{collections::HashSet, sync::Arc};

impl Pass {
    /// The host's buffers in storage blocks that some shader may write, each once.
    ///
    /// A buffer of the host never changes: what a shader writes into it is not visible outside the pass. So
    /// executors give all storage blocks of the pass that lie in such a buffer a copy of it. Vertices, indices and
    /// uniform blocks keep the host's bytes, which validation has read. Buffers of a device are not among them:
    /// shaders write them in place. Expects a valid pass.
    pub(crate) fn written_buffers(&self) -> Vec<Arc<BufferSource>> {
        let (mut found, mut known) = (Vec::new(), HashSet::new());
        for draw in &self.draws {
            let pipeline = &self.pipelines[draw.pipeline];
            for shader in [&pipeline.vertex, &pipeline.fragment] {
                for &number in &shader.details.written {
                    let resource = &shader.reflection.resources[number as usize];
                    let set = draw.sets.get(resource.set as usize);
                    let entries = set.into_iter().flat_map(|set| &set.entries);
                    let bound = entries.filter(|entry| entry.binding == resource.binding);
                    for binding in bound.flat_map(|entry| &entry.resources) {
                        if let Binding::Storage(range) = binding
                            && range.buffer.host_bytes().is_some()
                            && known.insert(Arc::as_ptr(&range.buffer))
                        {
                            found.push(range.buffer.clone());
                        }
                    }
                }
            }
        }
        found
    }
}
