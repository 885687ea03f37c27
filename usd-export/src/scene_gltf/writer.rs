//! What the parts of a scene add to: the JSON of the file, its binary part, and the materials and extensions so far.

use std::collections::BTreeSet;

use gltf_json::accessor::{Accessor, ComponentType, GenericComponentType, Type};
use gltf_json::buffer::{Stride, Target, View};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::validation::Checked::Valid;
use gltf_json::validation::USize64;
use gltf_json::{Index, Root};
use pumice_core::Error;
use pumice_scene::Material;
use serde_json::Value as Json;

use super::binary::{Binary, write_corners};
use super::materials::Materials;
use crate::Result;

/// Most vertices of a primitive: the greatest index of 32 bits is reserved.
const MOST_VERTICES: u64 = u32::MAX as u64;

/// The parts of a file, while they are planned.
#[derive(Default)]
pub(super) struct Writer<'a> {
    pub(super) root: Root,
    pub(super) binary: Binary<'a>,
    pub(super) used: BTreeSet<&'static str>,
    materials: Materials,
    /// The view of the corners of rectangles ([`write_corners`]), whose place is known at the end; none where there is no rectangle.
    corners: Option<Index<View>>,
    /// Rectangles of the largest primitive.
    most_rectangles: u64,
}

/// What an accessor says of its elements.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elements {
    pub(super) type_: Type,
    pub(super) component: ComponentType,
    pub(super) is_normalized: bool,
    pub(super) offset: u64,
    pub(super) count: u64,
}

fn view(offset: u64, bytes: u64, stride: Option<usize>, target: Target) -> View {
    View {
        buffer: Index::new(0),
        byte_length: USize64(bytes),
        byte_offset: Some(USize64(offset)),
        byte_stride: stride.map(Stride),
        name: None,
        target: Some(Valid(target)),
        extensions: None,
        extras: None,
    }
}

impl Writer<'_> {
    /// Adds a view of vertices, or of corners of triangles where they have no stride.
    pub(super) fn view(&mut self, offset: u64, bytes: u64, stride: Option<usize>) -> Index<View> {
        let target = if stride.is_some() { Target::ArrayBuffer } else { Target::ElementArrayBuffer };
        self.root.push(view(offset, bytes, stride, target))
    }

    /// Adds a view of data that is neither: attributes of instances.
    pub(super) fn plain_view(&mut self, offset: u64, bytes: u64) -> Index<View> {
        self.root.push(View { target: None, ..view(offset, bytes, None, Target::ArrayBuffer) })
    }

    /// Adds an accessor, with its least and greatest elements where a reader needs them.
    pub(super) fn accessor(
        &mut self,
        view: Index<View>,
        elements: Elements,
        bounds: Option<[Json; 2]>,
    ) -> Index<Accessor> {
        let [min, max] = bounds.map_or([None, None], |bounds| bounds.map(Some));
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: (elements.offset > 0).then_some(USize64(elements.offset)),
            count: USize64(elements.count),
            component_type: Valid(GenericComponentType(elements.component)),
            extensions: None,
            extras: None,
            type_: Valid(elements.type_),
            min,
            max,
            name: None,
            normalized: elements.is_normalized,
            sparse: None,
        })
    }

    /// Adds an accessor of the corners of the triangles of `rectangles` rectangles, whose vertices follow each other.
    ///
    /// # Errors
    /// As [`addressable`].
    pub(super) fn corners(&mut self, rectangles: u64) -> Result<Index<Accessor>> {
        addressable(4 * rectangles)?;
        self.most_rectangles = self.most_rectangles.max(rectangles);
        let elements = Elements {
            type_: Type::Scalar,
            component: ComponentType::U32,
            is_normalized: false,
            offset: 0,
            count: 6 * rectangles,
        };
        let view = match self.corners {
            Some(view) => view,
            None => self.root.push(view(0, 0, None, Target::ElementArrayBuffer)),
        };
        self.corners = Some(view);
        Ok(self.accessor(view, elements, None))
    }

    /// A primitive of triangles with this material.
    ///
    /// # Errors
    /// None that a valid material gives.
    pub(super) fn primitive(
        &mut self,
        attributes: impl IntoIterator<Item = (Semantic, Index<Accessor>)>,
        corners: Index<Accessor>,
        material: &Material,
    ) -> Result<Primitive> {
        Ok(Primitive {
            attributes: attributes
                .into_iter()
                .map(|(semantic, accessor)| (Valid(semantic), accessor))
                .collect(),
            extensions: None,
            extras: None,
            indices: Some(corners),
            material: Some(self.materials.place(material, &mut self.root, &mut self.used)?),
            mode: Valid(Mode::Triangles),
            targets: None,
        })
    }

    /// Adds the section that all rectangles share, if there are any; their positions are whole numbers.
    pub(super) fn finish(&mut self) {
        let Some(corners) = self.corners else {
            return;
        };
        self.used.insert(super::QUANTIZATION);
        let (rectangles, bytes) = (self.most_rectangles, 24 * self.most_rectangles);
        let offset =
            self.binary.add(bytes, move |out| write_corners(rectangles, 4, &[0, 1, 2, 0, 2, 3], out));
        self.root.buffer_views[corners.value()] = view(offset, bytes, None, Target::ElementArrayBuffer);
    }
}

/// Checks that indices of 32 bits reach this many vertices of a primitive.
///
/// # Errors
/// [`Error::Limit`].
pub(super) fn addressable(vertices: u64) -> Result<()> {
    if vertices <= MOST_VERTICES {
        return Ok(());
    }
    let what = "vertices of one material in a glTF file".into();
    Err(Error::Limit { what, limit: MOST_VERTICES, got: vertices }.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_beyond_32_bits_are_refused() {
        let mut writer = Writer::default();
        assert!(writer.corners((1 << 30) - 1).is_ok(), "the last index is 2³² − 5");
        let error = writer.corners(1 << 30).unwrap_err().to_string();
        assert_eq!(
            error,
            "vertices of one material in a glTF file: 4294967296 is more than the limit of 4294967295"
        );
    }
}
