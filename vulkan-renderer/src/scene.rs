//! A scene on the device, divided into parts that edits replace one by one.
//!
//! ```text
//! SceneHeader ─┬─ Sky       lights, environment tables                  renewed by: world, suns, lamps
//!  (+ Instance │
//!  records,    ├─ Nodes     nodes and leaves, as compressed             renewed by: another volume, a label that was not shown before
//!  new with    ├─ Boxes     boxes, labels, hierarchy; bricks            renewed by: level of detail; visibility (`showing.rs`)
//!  each edit)  ├─ Triangles corners, triangles, normals, hierarchy      renewed by: another mesh
//!              ├─ Materials materials, and the material of each label   renewed by: colours
//!              ├─ Emitters  emissive surfaces and their light tree      renewed by: emissive materials; place, shape and neighbours
//!              ├─ Cuts      planes that cut parts away                  renewed by: cuts, placements
//!              ├─ Tree      hierarchy over many instances               renewed by: placements
//!              └─ filter    table of the pixel filter                   renewed by: film
//! ```
//! The header and the instances' records are a few hundred bytes and are rewritten with each edit. A camera move sends nothing else.

mod showing;

use std::sync::Arc;

use glam::DAffine3;
use pumice_core::{CompressedVolume, MeshData, NoMemory};
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::geometry::drawn_pages::refused;
use pumice_transport::geometry::{Contacts, Cuts, Detail, InstanceTree, LodChoice, Placement, WorldBounds};
use pumice_transport::{BoxBounds, Bvh, Emitters, FilterTable, Lights, MaterialTable, RenderError};

use crate::device::{Acceleration, Buffer, DeviceError, Gpu};
use crate::layout;
use crate::pack::{
    self, PackedBoxes, PackedBricks, PackedEmitters, PackedMaterials, PackedMesh, PackedNodes, PackedSky,
};
use crate::pages::{PagedVolume, ScenePages};

pub(crate) use showing::Former;
use showing::{Fewer, Widest};

/// Why a part could not be put on the device.
#[derive(Debug)]
pub(crate) enum UploadError {
    /// The device failed.
    Device(DeviceError),
    /// The scene or one of its files is at fault.
    Scene(RenderError),
}

impl From<DeviceError> for UploadError {
    fn from(e: DeviceError) -> Self {
        Self::Device(e)
    }
}

impl From<RenderError> for UploadError {
    fn from(e: RenderError) -> Self {
        Self::Scene(e)
    }
}

/// Nodes and leaves of a volume.
#[derive(Debug)]
pub(crate) struct Nodes {
    volume: Arc<CompressedVolume>,
    packed: PackedNodes,
    nodes: Buffer,
    leaves: Buffer,
}

impl Nodes {
    pub(crate) fn new(
        gpu: &Gpu,
        volume: &Arc<CompressedVolume>,
        wanted: &[bool],
    ) -> Result<Self, UploadError> {
        let packed = PackedNodes::new(volume, wanted);
        let words = packed.packed(volume).map_err(RenderError::from)?;
        let nodes = gpu.buffer_of("the nodes of a volume", bytemuck::cast_slice(&words))?;
        let leaves = PackedNodes::leaves(volume.leaves().iter()).map_err(RenderError::from)?;
        let leaves = gpu.buffer_of("the leaves of a volume", &leaves)?;
        Ok(Self { volume: Arc::clone(volume), packed, nodes, leaves })
    }

    /// Whether these are the nodes of this very volume.
    pub(crate) fn is_of(&self, volume: &Arc<CompressedVolume>) -> bool {
        Arc::ptr_eq(&self.volume, volume)
    }

    pub(crate) fn covers(&self, wanted: &[bool]) -> bool {
        self.packed.covers(wanted)
    }

    fn bytes(&self) -> [u64; 2] {
        [self.nodes.bytes(), self.leaves.bytes()]
    }
}

/// Decides what is drawn of a volume, and how.
pub(crate) struct Drawn<'a> {
    /// The instance's number in the scene.
    pub(crate) place: u32,
    pub(crate) volume: &'a Arc<CompressedVolume>,
    /// Which labels are visible.
    pub(crate) visible: &'a [bool],
    pub(crate) lod: LodChoice,
    /// Voxels have smooth normals.
    pub(crate) smooth: bool,
    /// The boxes of invisible labels are included too, without their voxels. Their nodes must be on the device.
    pub(crate) hidden_too: bool,
}

/// What is drawn of a volume, for one instance of the scene.
#[derive(Debug)]
pub(crate) struct Boxes {
    content: Content,
    /// The instance's record; placement, materials and their addresses are 0, and those of pages.
    record: layout::Instance,
    /// The widest choice of labels (see `showing.rs`), where these boxes are of a subset of it.
    widest: Option<Widest>,
}

/// Where the boxes of a volume are.
#[derive(Debug)]
enum Content {
    /// All of them on the device.
    Whole(Box<WholeBoxes>),
    /// A subset of what was made for the widest choice of labels.
    Fewer(Fewer),
    /// Some on the device, in pages; `None` where nothing is drawn.
    Paged(Option<Arc<PagedVolume>>),
}

/// The boxes that are drawn of a volume.
#[derive(Debug)]
struct WholeBoxes {
    /// For which instance they were made, at which levels, and whether hidden ones are among them.
    place: u32,
    lod: LodChoice,
    hidden_too: bool,
    /// The number of each box in the volume, on the host; empty where rays do not traverse bricks.
    items: Vec<u32>,
    nodes: Arc<Nodes>,
    chunks: Buffer,
    boxes: Buffer,
    labels: Buffer,
    /// The same voxels as bricks, all labels together, where all boxes are drawn at one level of detail.
    bricks: Option<BricksOnDevice>,
    /// BVH over boxes for compute shaders: nodes and items. `None` where the device's own acceleration structure is used, and where shaders
    /// traverse bricks without a hierarchy.
    bvh: Option<[Buffer; 2]>,
    acceleration: Option<Acceleration>,
    /// Neighbouring boxes, where voxels have smooth normals.
    neighbors: Option<Buffer>,
}

impl Boxes {
    pub(crate) fn new(gpu: &Gpu, what: &Drawn<'_>, nodes: Arc<Nodes>) -> Result<Self, UploadError> {
        let &Drawn { place, volume, visible, lod, smooth, hidden_too } = what;
        let tight = lod == LodChoice::Voxels;
        let limit = |error| match error {
            RenderError::Scene(what) => RenderError::Scene(format!("instances[{place}]: {what}")),
            other => other,
        };
        let mut packed = if hidden_too {
            let mut packed =
                PackedBoxes::new(volume, &nodes.packed, &vec![true; visible.len()], tight).map_err(limit)?;
            let PackedBoxes { chunks, boxes, labels, .. } = &mut packed;
            pack::take_voxels(chunks, boxes, labels, &nodes.packed, visible).map_err(limit)?;
            packed
        } else {
            PackedBoxes::new(volume, &nodes.packed, visible, tight).map_err(limit)?
        };
        let mut record = packed.record();
        let chunks = gpu.buffer_of("the chunks of a volume", bytemuck::cast_slice(&packed.chunks))?;
        let boxes = gpu.buffer_of("the boxes of a volume", bytemuck::cast_slice(&packed.boxes))?;
        let labels = gpu.buffer_of("the labels of boxes", bytemuck::cast_slice(&packed.labels))?;
        let in_bricks = match suits_bricks(gpu) {
            true => PackedBricks::new(volume, &packed, visible, lod).map_err(RenderError::from)?,
            false => None,
        };
        let bricks = in_bricks.as_ref().map(|b| BricksOnDevice::new(gpu, b, &mut record)).transpose()?;
        let (bvh, acceleration) = match &in_bricks {
            None => hierarchy(gpu, place, &mut record, || packed.aabbs(), || packed.numbered())?,
            // Shaders traverse bricks as a grid. Only hardware ray tracing needs a hierarchy over them.
            Some(bricks) if gpu.backend().uses_hardware_hierarchy() => {
                hierarchy(gpu, place, &mut record, || bricks.aabbs(packed.around_all()), || Ok(Vec::new()))?
            }
            Some(_) => (None, None),
        };
        record.chunks = chunks.address();
        record.boxes = boxes.address();
        record.labels = labels.address();
        record.nodes = nodes.nodes.address();
        record.leaves = nodes.leaves.address();
        let neighbors = match smooth {
            true => {
                let neighbors = packed.neighbors().map_err(RenderError::from)?;
                Some(gpu.buffer_of("the neighbours of boxes", bytemuck::cast_slice(&neighbors))?)
            }
            false => None,
        };
        record.neighbors = neighbors.as_ref().map_or(0, Buffer::address);
        let items = if bricks.is_some() { std::mem::take(&mut packed.items) } else { Vec::new() };
        let whole = WholeBoxes {
            place,
            lod,
            hidden_too,
            items,
            nodes,
            chunks,
            boxes,
            labels,
            bricks,
            bvh,
            acceleration,
            neighbors,
        };
        Ok(Self { content: Content::Whole(Box::new(whole)), record, widest: None })
    }

    /// The pages of a volume on disk, with the levels of `detail`; those that `former` draws alike are those of `former`.
    pub(crate) fn in_pages(
        gpu: &Gpu,
        what: &Drawn<'_>,
        detail: Detail,
        former: Option<&Self>,
    ) -> Result<Self, UploadError> {
        let &Drawn { volume, visible, lod, smooth, hidden_too, .. } = what;
        if smooth {
            return Err(refused("smooth shading of voxels (smooth_voxels)").into());
        }
        if hidden_too {
            return Err(refused("a measurement of hidden labels").into());
        }
        let former = former.and_then(|f| f.paged()).map(Arc::as_ref);
        let is_tight = lod == LodChoice::Voxels;
        let (paged, record) = PagedVolume::new(gpu, volume, visible, (detail, is_tight), former)?;
        Ok(Self { content: Content::Paged(paged.map(Arc::new)), record, widest: None })
    }

    /// Whether rays traverse bricks.
    pub(crate) fn has_bricks(&self) -> bool {
        match &self.content {
            Content::Whole(whole) => whole.bricks.is_some(),
            Content::Fewer(fewer) => fewer.has_bricks(),
            Content::Paged(paged) => paged.is_some(),
        }
    }

    /// Whether rays traverse boxes.
    pub(crate) fn has_boxes(&self) -> bool {
        !matches!(self.content, Content::Paged(_)) && !self.has_bricks()
    }

    /// What is drawn in pages, if anything is.
    pub(crate) fn paged(&self) -> Option<&Arc<PagedVolume>> {
        match &self.content {
            Content::Whole(_) | Content::Fewer(_) => None,
            Content::Paged(paged) => paged.as_ref(),
        }
    }

    /// Whether they can be drawn with these levels of detail. (What is on the device as a whole can with any; a page has those of its boxes.)
    pub(crate) fn suit(&self, detail: &Detail) -> bool {
        self.paged().is_none_or(|paged| paged.detail() == detail)
    }

    /// Nodes of a volume that is on the device as a whole.
    pub(crate) fn nodes(&self) -> Option<&Arc<Nodes>> {
        match &self.content {
            Content::Whole(whole) => Some(&whole.nodes),
            Content::Fewer(_) => self.widest.as_ref().and_then(|widest| widest.boxes().nodes()),
            Content::Paged(_) => None,
        }
    }
}

/// Whether rays should traverse bricks where these can be built. They should not where hardware traces and doubles are emulated with
/// integers: testing a brick then takes more time than testing its boxes, by a quarter on Mesa's driver (docs/measured.md).
fn suits_bricks(gpu: &Gpu) -> bool {
    !gpu.backend().uses_hardware_hierarchy() || gpu.candidate().native_f64
}

/// The drawn voxels of a volume as bricks, all labels together.
#[derive(Debug)]
struct BricksOnDevice {
    blocks: Buffer,
    bricks: Buffer,
    fields: Buffer,
    parts: Buffer,
    /// Where hardware finds bricks.
    corners: Option<Buffer>,
    /// Number of blocks, bricks, fields and parts.
    counts: [usize; 4],
}

impl BricksOnDevice {
    /// Uploads the bricks and writes their addresses into the record.
    fn new(gpu: &Gpu, packed: &PackedBricks, record: &mut layout::Instance) -> Result<Self, DeviceError> {
        let blocks = gpu.buffer_of("the blocks of a volume", bytemuck::cast_slice(&packed.blocks))?;
        let bricks = gpu.buffer_of("the bricks of a volume", bytemuck::cast_slice(&packed.bricks))?;
        let fields = gpu.buffer_of("the voxels of bricks", bytemuck::cast_slice(&packed.fields))?;
        let parts = gpu.buffer_of("the boxes of bricks", bytemuck::cast_slice(&packed.parts))?;
        let corners = match gpu.backend().uses_hardware_hierarchy() {
            true => Some(gpu.buffer_of("the corners of bricks", bytemuck::cast_slice(&packed.corners))?),
            false => None,
        };
        record.blocks = blocks.address();
        record.bricks = bricks.address();
        record.brick_fields = fields.address();
        record.brick_parts = parts.address();
        record.brick_corners = corners.as_ref().map_or(0, Buffer::address);
        let counts = [packed.blocks.len(), packed.bricks.len(), packed.fields.len(), packed.parts.len()];
        Ok(Self { blocks, bricks, fields, parts, corners, counts })
    }

    fn bytes(&self) -> u64 {
        let corners = self.corners.as_ref().map_or(0, Buffer::bytes);
        self.blocks.bytes() + self.bricks.bytes() + self.fields.bytes() + self.parts.bytes() + corners
    }
}

/// Builds a hierarchy on the device and writes its address into the record: a BVH where compute shaders traverse it, otherwise the device's
/// own acceleration structure.
fn hierarchy(
    gpu: &Gpu,
    place: u32,
    record: &mut layout::Instance,
    aabbs: impl FnOnce() -> Result<Vec<[f32; 6]>, NoMemory>,
    numbered: impl FnOnce() -> Result<Vec<(BoxBounds, u32)>, NoMemory>,
) -> Result<(Option<[Buffer; 2]>, Option<Acceleration>), UploadError> {
    if gpu.backend().uses_hardware_hierarchy() {
        if record.box_count == 0 {
            return Ok((None, None));
        }
        let aabbs = aabbs().map_err(RenderError::from)?;
        let built = gpu.acceleration(place, aabbs.len() as u32, |i| aabbs[i as usize])?;
        record.acceleration = built.address();
        return Ok((None, Some(built)));
    }
    let built = Bvh::build(numbered().map_err(RenderError::from)?)?;
    let nodes = gpu.buffer_of("a hierarchy", built.node_bytes())?;
    let items = gpu.buffer_of("the items of a hierarchy", bytemuck::cast_slice(built.items()))?;
    (record.bvh_nodes, record.bvh_items) = (nodes.address(), items.address());
    Ok((Some([nodes, items]), None))
}

/// Triangles of a mesh, for the instance of one number.
#[derive(Debug)]
pub(crate) struct Triangles {
    mesh_from_grid: DAffine3,
    corners: Buffer,
    triangles: Buffer,
    materials: Buffer,
    /// Vertex normals, where some triangle is shaded smooth.
    normals: Option<Buffer>,
    bvh: Option<[Buffer; 2]>,
    acceleration: Option<Acceleration>,
    /// The instance's record; placement, materials and their addresses are 0.
    record: layout::Instance,
}

impl Triangles {
    /// Uploads the mesh at `place` among the scene's meshes.
    pub(crate) fn new(gpu: &Gpu, place: u32, instance: u32, mesh: &MeshData) -> Result<Self, UploadError> {
        let packed = PackedMesh::new(place, mesh)?;
        let mut record = packed.record();
        let corners = gpu.buffer_of("the corners of a mesh", bytemuck::cast_slice(&packed.grid.corners))?;
        let triangles = gpu.buffer_of("the triangles of a mesh", bytemuck::cast_slice(mesh.triangles()))?;
        let materials =
            gpu.buffer_of("the materials of triangles", bytemuck::cast_slice(&packed.materials))?;
        let normals = match mesh.normals() {
            [] => None,
            all => Some(gpu.buffer_of("the normals of a mesh", bytemuck::cast_slice(all))?),
        };
        let mesh_from_grid = packed.grid.mesh_from_grid;
        let (bvh, acceleration) =
            hierarchy(gpu, instance, &mut record, || packed.aabbs(), || Ok(packed.bounds.clone()))?;
        record.nodes = corners.address();
        record.boxes = triangles.address();
        record.labels = materials.address();
        record.leaves = normals.as_ref().map_or(0, Buffer::address);
        Ok(Self { mesh_from_grid, corners, triangles, materials, normals, bvh, acceleration, record })
    }

    /// Transform from the mesh's grid to the mesh's own space.
    pub(crate) fn mesh_from_grid(&self) -> DAffine3 {
        self.mesh_from_grid
    }
}

/// A mesh of the scene.
#[derive(Clone, Debug)]
pub(crate) struct MeshOnDevice {
    pub(crate) triangles: Arc<Triangles>,
    pub(crate) materials: Arc<MaterialsOnDevice>,
    /// Placement of the mesh's grid in the world.
    pub(crate) placement: Placement,
}

impl MeshOnDevice {
    fn record(&self) -> layout::Instance {
        let mut record = self.triangles.record;
        pack::place_mesh(&mut record, &self.placement);
        let materials = &self.materials;
        materials.describe(&mut record);
        record
    }
}

/// Materials of an instance or a mesh.
#[derive(Debug)]
pub(crate) struct MaterialsOnDevice {
    pub(crate) table: Arc<MaterialTable>,
    pub(crate) packed: PackedMaterials,
    materials: Buffer,
    of_label: Buffer,
    ids: Option<Buffer>,
}

impl MaterialsOnDevice {
    pub(crate) fn new(gpu: &Gpu, table: MaterialTable) -> Result<Self, DeviceError> {
        let packed = PackedMaterials::new(&table);
        let materials = gpu.buffer_of("materials", bytemuck::cast_slice(&packed.materials))?;
        let of_label = gpu.buffer_of("materials of labels", bytemuck::cast_slice(&packed.of_label))?;
        let ids = match packed.ids.is_empty() {
            true => None,
            false => Some(gpu.buffer_of("ids of labels", bytemuck::cast_slice(&packed.ids))?),
        };
        Ok(Self { table: Arc::new(table), packed, materials, of_label, ids })
    }

    fn describe(&self, record: &mut layout::Instance) {
        let ids = self.ids.as_ref().map_or(0, Buffer::address);
        self.packed.describe(record, self.materials.address(), self.of_label.address(), ids);
    }

    fn bytes(&self) -> u64 {
        self.materials.bytes() + self.of_label.bytes() + self.ids.as_ref().map_or(0, Buffer::bytes)
    }
}

/// Cut planes of an instance.
#[derive(Debug)]
pub(crate) struct CutsOnDevice {
    pub(crate) cuts: Cuts,
    planes: Option<Buffer>,
}

impl CutsOnDevice {
    pub(crate) fn new(gpu: &Gpu, cuts: Cuts) -> Result<Self, DeviceError> {
        let planes = pack::cut_planes(&cuts);
        let planes = match planes.is_empty() {
            true => None,
            false => Some(gpu.buffer_of("the planes of cuts", bytemuck::cast_slice(&planes))?),
        };
        Ok(Self { cuts, planes })
    }
}

/// An instance. Instances may share each of these parts.
#[derive(Clone, Debug)]
pub(crate) struct InstanceOnDevice {
    pub(crate) boxes: Arc<Boxes>,
    pub(crate) materials: Arc<MaterialsOnDevice>,
    pub(crate) cuts: Arc<CutsOnDevice>,
    pub(crate) placement: Placement,
    pub(crate) lod: LodChoice,
}

impl InstanceOnDevice {
    fn record(&self, pages: Option<&ScenePages>) -> layout::Instance {
        let mut record = self.boxes.record;
        if let (Some(pages), Some(volume)) = (pages, self.boxes.paged()) {
            pages.describe(volume, &mut record);
        }
        pack::place(&mut record, &self.placement, self.lod);
        record.cut_planes = self.cuts.planes.as_ref().map_or(0, Buffer::address);
        record.cut_plane_count = self.cuts.cuts.planes().len() as u32;
        let materials = &self.materials;
        materials.describe(&mut record);
        record
    }
}

/// Lights and sky.
#[derive(Debug)]
pub(crate) struct SkyOnDevice {
    lights_record: layout::Lights,
    environment: layout::Environment,
    buffers: Vec<Buffer>,
}

impl SkyOnDevice {
    pub(crate) fn new(gpu: &Gpu, lights: &Lights) -> Result<Self, DeviceError> {
        let mut buffers = Vec::new();
        let mut put = |what, bytes: &[u8]| -> Result<u64, DeviceError> {
            let buffer = gpu.buffer_of(what, bytes)?;
            let address = buffer.address();
            buffers.push(buffer);
            Ok(address)
        };
        let suns = put("suns", bytemuck::cast_slice(&pack::suns(lights)))?;
        let lamps = put("lamps", bytemuck::cast_slice(&pack::lamps(lights)))?;
        let (nodes, cones) = pack::lamp_tree(lights);
        let mut tree = [0; 2];
        if !nodes.is_empty() {
            tree[0] = put("the tree of lamps", bytemuck::cast_slice(&nodes))?;
        }
        if !cones.is_empty() {
            tree[1] = put("the directions of lamps", bytemuck::cast_slice(&cones))?;
        }
        let lights_record = pack::lights(lights, [suns, lamps, tree[0], tree[1]]);
        let mut environment = layout::Environment::default();
        if let Some(sky) = PackedSky::new(lights) {
            let [pixels, rows, columns, densities] = sky.parts();
            environment = sky.record([
                put("the sky's picture", pixels)?,
                put("the sky's rows", rows)?,
                put("the sky's columns", columns)?,
                put("the sky's densities", densities)?,
            ]);
        }
        Ok(Self { lights_record, environment, buffers })
    }
}

/// Emissive surfaces, which are sampled as lights.
#[derive(Debug)]
pub(crate) struct EmittersOnDevice {
    /// Irradiance estimate of all emissive surfaces together, which weighs them against other lights.
    pub(crate) irradiance: f32,
    record: layout::Emitters,
    buffers: Vec<Buffer>,
}

impl EmittersOnDevice {
    pub(crate) fn new(gpu: &Gpu, emitters: &Emitters) -> Result<Self, DeviceError> {
        let packed = PackedEmitters::new(emitters);
        let (mut buffers, mut at) = (Vec::new(), [0; 7]);
        for (address, (what, bytes)) in at.iter_mut().zip(packed.parts()) {
            if !bytes.is_empty() {
                let buffer = gpu.buffer_of(what, bytes)?;
                *address = buffer.address();
                buffers.push(buffer);
            }
        }
        Ok(Self { irradiance: emitters.irradiance(), record: packed.record(at), buffers })
    }
}

/// Inverse-cdf table of the pixel filter.
#[derive(Debug)]
pub(crate) struct FilterOnDevice {
    table: Buffer,
    record: layout::Filter,
}

impl FilterOnDevice {
    pub(crate) fn new(gpu: &Gpu, filter: &pumice_scene::Filter) -> Result<Self, DeviceError> {
        let host = FilterTable::new(filter);
        let table = gpu.buffer_of("the filter's table", bytemuck::cast_slice(host.inverse()))?;
        let steps = (host.inverse().len() as u32).saturating_sub(1);
        let inverse = if steps == 0 { 0 } else { table.address() };
        let record = layout::Filter { inverse, width: host.width(), steps };
        Ok(Self { table, record })
    }
}

/// The hierarchy over instances.
#[derive(Debug)]
pub(crate) struct TreeOnDevice {
    record: layout::InstanceTree,
    buffers: [Buffer; 2],
}

impl TreeOnDevice {
    /// Builds the hierarchy over these instances and meshes. `None` where there are too few to need one.
    pub(crate) fn new(
        gpu: &Gpu,
        instances: &[InstanceOnDevice],
        meshes: &[MeshOnDevice],
        least: usize,
    ) -> Result<Option<Self>, UploadError> {
        if instances.len() + meshes.len() < least {
            return Ok(None);
        }
        let bounds_of = |record: &layout::Instance, placement: &Placement| {
            let bounds = BoxBounds { lo: record.lo, hi: record.hi };
            (record.box_count > 0).then(|| WorldBounds::new(bounds, placement))
        };
        let of_instances = instances.iter().map(|i| bounds_of(&i.boxes.record, &i.placement));
        let of_meshes = meshes.iter().map(|m| bounds_of(&m.triangles.record, &m.placement));
        let Some(tree) = InstanceTree::new(of_instances.chain(of_meshes), least)? else { return Ok(None) };
        let nodes = gpu.buffer_of("a hierarchy over instances", tree.bvh().node_bytes())?;
        let items = gpu.buffer_of("the items of one", bytemuck::cast_slice(tree.bvh().items()))?;
        let record = pack::instance_tree(&tree, [nodes.address(), items.address()]);
        Ok(Some(Self { record, buffers: [nodes, items] }))
    }
}

/// The parts of a scene on a device.
#[derive(Debug)]
pub(crate) struct SceneParts {
    pub(crate) instances: Vec<InstanceOnDevice>,
    pub(crate) meshes: Vec<MeshOnDevice>,
    pub(crate) sky: Arc<SkyOnDevice>,
    pub(crate) emitters: Option<Arc<EmittersOnDevice>>,
    pub(crate) filter: Arc<FilterOnDevice>,
    /// The hierarchy over instances, where there is one.
    pub(crate) tree: Option<Arc<TreeOnDevice>>,
    /// Where volumes touch.
    pub(crate) contacts: Option<Contacts>,
}

/// All parts together, with the header through which shaders find them.
#[derive(Debug)]
pub(crate) struct SceneOnDevice {
    pub(crate) parts: SceneParts,
    records: Buffer,
    header: Buffer,
}

impl SceneOnDevice {
    /// Uploads the list of instances and the header of these parts; `pages` are those of its volumes that are drawn in pages.
    pub(crate) fn new(
        gpu: &Gpu,
        tables: &Buffer,
        parts: SceneParts,
        pages: Option<&ScenePages>,
        rays: &CameraRays,
        settings: layout::Settings,
    ) -> Result<Self, DeviceError> {
        let SceneParts { instances, meshes, sky, emitters, filter, tree, contacts } = &parts;
        let of_meshes = meshes.iter().map(MeshOnDevice::record);
        let mut list: Vec<_> = instances.iter().map(|i| i.record(pages)).chain(of_meshes).collect();
        for (record, number) in list.iter_mut().zip(0..) {
            record.body = contacts.as_ref().and_then(|c| c.body(number)).unwrap_or(number);
        }
        let records = gpu.buffer_of("the list of instances", bytemuck::cast_slice(&list))?;
        let header = layout::SceneHeader {
            instances: records.address(),
            tables: tables.address(),
            camera: pack::camera(rays),
            filter: filter.record,
            settings,
            lights: layout::Lights {
                emitters_irradiance: emitters.as_ref().map_or(0.0, |e| e.irradiance),
                is_sampled: sky.lights_record.is_sampled
                    | u32::from(emitters.as_ref().is_some_and(|e| e.irradiance > 0.0)),
                ..sky.lights_record
            },
            environment: sky.environment,
            emitters: emitters.as_ref().map_or_else(layout::Emitters::default, |e| e.record),
            instance_tree: tree.as_ref().map_or_else(layout::InstanceTree::default, |t| t.record),
            instance_count: list.len() as u32,
            film_width: rays.size[0] as u32,
            contact_distance: contacts.as_ref().map_or(0.0, Contacts::distance),
        };
        let header = gpu.buffer_of("the scene's header", bytemuck::bytes_of(&header))?;
        Ok(Self { parts, records, header })
    }

    /// Device address of the header.
    pub(crate) fn address(&self) -> u64 {
        self.header.address()
    }

    /// Bytes on the device by part; shared parts count once.
    pub(crate) fn bytes(&self) -> [(&'static str, u64); 8] {
        let mut seen = std::collections::BTreeSet::new();
        let mut first = |pointer: *const u8| seen.insert(pointer.addr());
        let (mut nodes, mut leaves, mut boxes, mut labels, mut hierarchy, mut materials) = (0, 0, 0, 0, 0, 0);
        let mut bricks = 0;
        for i in &self.parts.instances {
            let widest = i.boxes.widest.iter().map(Widest::boxes);
            for of in widest.chain([&i.boxes]).filter(|of| first(Arc::as_ptr(of).cast())) {
                match &of.content {
                    Content::Whole(whole) => {
                        boxes += whole.boxes.bytes() + whole.chunks.bytes();
                        boxes += whole.neighbors.as_ref().map_or(0, Buffer::bytes);
                        labels += whole.labels.bytes();
                        bricks += whole.bricks.as_ref().map_or(0, BricksOnDevice::bytes);
                        hierarchy += whole.acceleration.as_ref().map_or(0, Acceleration::bytes)
                            + whole.bvh.iter().flatten().map(Buffer::bytes).sum::<u64>();
                    }
                    Content::Fewer(Fewer::Bricks(fewer, built)) => {
                        bricks += fewer.bytes();
                        hierarchy += built.as_ref().map_or(0, Acceleration::bytes);
                    }
                    Content::Fewer(Fewer::Boxes(fewer)) => boxes += fewer.bytes(),
                    Content::Paged(_) => (),
                }
            }
            if let Some(of) = i.boxes.nodes()
                && first(Arc::as_ptr(of).cast())
            {
                let [n, l] = of.bytes();
                (nodes, leaves) = (nodes + n, leaves + l);
            }
            if let Some(paged) = i.boxes.paged()
                && first(Arc::as_ptr(paged).cast())
            {
                leaves += paged.leaf_bytes();
            }
            if first(Arc::as_ptr(&i.materials).cast()) {
                materials += i.materials.bytes();
            }
        }
        let cuts = self
            .parts
            .instances
            .iter()
            .filter_map(|i| i.cuts.planes.as_ref())
            .map(Buffer::bytes)
            .sum::<u64>();
        for m in &self.parts.meshes {
            if first(Arc::as_ptr(&m.triangles).cast()) {
                boxes += m.triangles.corners.bytes() + m.triangles.triangles.bytes();
                boxes += m.triangles.normals.as_ref().map_or(0, Buffer::bytes);
                labels += m.triangles.materials.bytes();
                hierarchy += m.triangles.acceleration.as_ref().map_or(0, Acceleration::bytes)
                    + m.triangles.bvh.iter().flatten().map(Buffer::bytes).sum::<u64>();
            }
            if first(Arc::as_ptr(&m.materials).cast()) {
                materials += m.materials.bytes();
            }
        }
        hierarchy += self.parts.tree.iter().flat_map(|t| &t.buffers).map(Buffer::bytes).sum::<u64>();
        let lights = self.parts.sky.buffers.iter().map(Buffer::bytes).sum::<u64>();
        let emitters = self.parts.emitters.iter().flat_map(|e| &e.buffers).map(Buffer::bytes).sum::<u64>();
        let tables = self.parts.filter.table.bytes() + self.records.bytes() + self.header.bytes();
        [
            ("acceleration", hierarchy),
            ("bricks", bricks),
            ("boxes", boxes),
            ("nodes", nodes),
            ("leaves", leaves),
            ("labels", labels),
            ("materials", materials + lights + cuts + tables),
            ("emitters", emitters),
        ]
    }
}
