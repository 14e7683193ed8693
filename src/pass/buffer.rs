//! Buffers of a pass: bytes of the host, or memory of a device.

use crate::{error::Result, vk};
use bytemuck::Pod;
use std::{borrow::Cow, sync::Arc};

/// Bytes for vertices, indices, uniform or storage blocks.
///
/// A buffer of the host ([`BufferSource::new`]) never changes. An executor uploads it once, and what shaders write into
/// it is gone after the pass. A buffer of a device ([`BufferSource::on_device`]) lives from pass to pass: the host, kernels
/// of yours and the shaders of a pass may write it, and all that runs later finds what they wrote.
#[derive(Clone, Debug, Default)]
pub struct BufferSource {
    label: String,
    content: Content,
}

#[derive(Clone, Debug)]
enum Content {
    Host(Vec<u8>),
    Device(vk::Buffer<u8>),
}

impl Default for Content {
    fn default() -> Self {
        Content::Host(Vec::new())
    }
}

impl BufferSource {
    /// A buffer of the host; `label` names it in messages and captures.
    pub fn new(label: impl Into<String>, bytes: Vec<u8>) -> Self {
        Self { label: label.into(), content: Content::Host(bytes) }
    }

    /// The memory of `buffer`, which belongs to a device. Only executors of that device take it. A slice begins at a
    /// multiple of 256 bytes, or the pass is refused.
    ///
    /// Nobody may know its content when a pass is planned. An index that it holds may be any number: a vertex
    /// beyond the end of an attribute's range reads the last element of the range. Each triangle then has three
    /// vertices of its own, unless [`super::Indices::vertices`] says which vertices are used.
    pub fn on_device<T: Pod>(buffer: &vk::Buffer<T>) -> Self {
        let all = buffer.cast().expect("any elements are whole bytes");
        Self { label: buffer.name().into(), content: Content::Device(all) }
    }

    /// Its name in messages and captures.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Bytes.
    pub fn len(&self) -> usize {
        match &self.content {
            Content::Host(bytes) => bytes.len(),
            Content::Device(buffer) => buffer.len(),
        }
    }

    /// Whether it has no bytes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The content of a buffer of the host.
    pub fn host_bytes(&self) -> Option<&[u8]> {
        match &self.content {
            Content::Host(bytes) => Some(bytes),
            Content::Device(_) => None,
        }
    }

    /// The memory of a buffer of a device.
    pub fn device_memory(&self) -> Option<&vk::Buffer<u8>> {
        match &self.content {
            Content::Host(_) => None,
            Content::Device(buffer) => Some(buffer),
        }
    }

    /// The content. If the buffer belongs to a device, its present content is copied to the host.
    ///
    /// # Errors
    /// As [`vk::Recording::run`] and [`vk::Buffer::read`].
    pub fn content(&self) -> Result<Cow<'_, [u8]>> {
        match &self.content {
            Content::Host(bytes) => Ok(Cow::Borrowed(bytes)),
            Content::Device(buffer) => buffer.download().map(Cow::Owned),
        }
    }
}

/// A range of a [`BufferSource`].
#[derive(Clone, Debug)]
pub struct BufferRange {
    /// The buffer.
    pub buffer: Arc<BufferSource>,
    /// First byte. A multiple of 256 where a shader binds it as a block
    /// (the largest alignment Vulkan lets a device ask for), of the size of one component for
    /// vertices, of the width of an index for indices.
    pub offset: usize,
    /// Bytes.
    pub bytes: usize,
}

impl BufferRange {
    /// All of `buffer`.
    pub fn whole(buffer: &Arc<BufferSource>) -> Self {
        Self { buffer: buffer.clone(), offset: 0, bytes: buffer.len() }
    }

    /// All of a new buffer of the host ([`BufferSource::new`]).
    pub fn host(label: impl Into<String>, bytes: impl Into<Vec<u8>>) -> Self {
        Self::whole(&Arc::new(BufferSource::new(label, bytes.into())))
    }

    /// All of a buffer that lives on a device ([`BufferSource::on_device`]).
    pub fn on_device<T: Pod>(buffer: &vk::Buffer<T>) -> Self {
        Self::whole(&Arc::new(BufferSource::on_device(buffer)))
    }

    /// The bytes, if the buffer is one of the host. The range lies in it.
    pub fn host_bytes(&self) -> Option<&[u8]> {
        self.buffer.host_bytes().map(|all| &all[self.offset..self.offset + self.bytes])
    }
}
