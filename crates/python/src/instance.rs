//! An instance, its parts and its mesh; and the scene that all Python objects made from it share, which keeps the
//! meshes.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::{DatasetError, Role, TriangleMesh, dataset, open, reference};
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::rows;
use crate::long_work::failed;

/// One object that methods provide textures for.
#[pyclass(frozen, module = "mateval")]
pub struct Instance {
    source: Arc<SharedScene>,
    at: usize,
    /// Its id: its folder in a submission.
    #[pyo3(get)]
    id: String,
    /// Its value in `View.instance`, from 1.
    #[pyo3(get)]
    index: u16,
    /// Its name in the source.
    #[pyo3(get)]
    name: String,
    /// Its role in the scene: `architecture`, `furniture`, `light_fixture` or `other`.
    #[pyo3(get)]
    role: &'static str,
    /// Its category; None where the source does not state it.
    #[pyo3(get)]
    category: Option<String>,
    /// Its broader category; None where the source does not state it.
    #[pyo3(get)]
    super_category: Option<String>,
    /// The number of its triangles.
    #[pyo3(get)]
    triangles: usize,
    /// Texels along a side of the baked truth; a submission's maps may have another size. None for glass and for shapes
    /// without area, which need no maps.
    #[pyo3(get)]
    atlas_size: Option<u32>,
}

impl Instance {
    /// The instance at this place of the scene, which must exist.
    pub fn new(source: &Arc<SharedScene>, at: usize) -> Self {
        let file = &source.file().instances[at];
        Self {
            source: Arc::clone(source),
            at,
            id: file.id.to_string(),
            index: file.index.0.get(),
            name: file.name.clone(),
            role: match file.role {
                Role::Architecture { .. } => "architecture",
                Role::Furniture {} => "furniture",
                Role::LightFixture {} => "light_fixture",
                Role::Other {} => "other",
            },
            category: file.category.clone(),
            super_category: file.super_category.clone(),
            triangles: file.triangles,
            atlas_size: file.atlas.as_ref().map(|atlas| atlas.size),
        }
    }
}

#[pymethods]
impl Instance {
    /// Its mesh. The first mesh of a scene that is read reads all others too.
    #[getter]
    fn mesh(&self, py: Python<'_>) -> PyResult<Mesh> {
        py.detach(|| self.source.mesh(self.at)).map(Mesh).map_err(failed)
    }

    /// The paths of a pickled instance: the copy opens the same folder.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (PathBuf, String, String))> {
        let reopen = py.import("mateval.dataset")?.getattr("reopened_instance")?;
        let root = std::path::absolute(&self.source.dataset.root)?;
        Ok((reopen, (root, self.source.file().id.to_string(), self.id.clone())))
    }

    fn __repr__(&self) -> String {
        format!("<mateval.Instance '{}', {} triangles>", self.id, self.triangles)
    }
}

/// A piece of an instance.
#[pyclass(frozen, get_all, module = "mateval")]
pub struct Part {
    /// Its id.
    id: String,
    /// Its value in `View.part`, from 1.
    index: u16,
    /// The id of its instance.
    instance: String,
    /// The number of its triangles.
    triangles: usize,
}

impl Part {
    pub fn new(file: &dataset::Part) -> Self {
        let (id, instance) = (file.id.to_string(), file.instance.to_string());
        Self { id, index: file.index.0.get(), instance, triangles: file.triangles }
    }
}

#[pymethods]
impl Part {
    fn __repr__(&self) -> String {
        format!("<mateval.Part '{}', {} triangles>", self.id, self.triangles)
    }
}

/// Triangles in world space: metres, +Y up.
#[pyclass(frozen, module = "mateval")]
pub struct Mesh(Arc<TriangleMesh>);

#[pymethods]
impl Mesh {
    /// Positions in metres: (vertices, 3), float32.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        rows(py, self.0.positions.iter().map(|position| position.to_array()))
    }

    /// Vertex indices, counter-clockwise seen from the front: (triangles, 3), uint32.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        rows(py, self.0.triangles.iter().copied())
    }

    /// Shading normals of unit length: (vertices, 3), float32; None where the faces are flat.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let normals = self.0.normals.as_ref();
        normals.map(|all| rows(py, all.iter().map(|normal| normal.to_array()))).transpose()
    }

    /// The atlas: (vertices, 2), float32. u runs to the right, v up from the bottom, as in trimesh and OBJ: the row of
    /// a map is (1 - v) * side. None for instances without an atlas.
    #[getter]
    fn uv<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let uvs = self.0.uvs.as_ref();
        uvs.map(|all| rows(py, all.iter().map(|uv| uv.to_array()))).transpose()
    }

    /// The mesh as a `trimesh.Trimesh` with the atlas as its uv. trimesh must be installed.
    fn to_trimesh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let trimesh = py.import("trimesh")?;
        let arguments = PyDict::new(py);
        arguments.set_item("vertices", self.vertices(py)?)?;
        arguments.set_item("faces", self.faces(py)?)?;
        arguments.set_item("vertex_normals", self.normals(py)?)?;
        // Its own clean-up would merge and reorder vertices.
        arguments.set_item("process", false)?;
        if let Some(uv) = self.uv(py)? {
            let texture = PyDict::new(py);
            texture.set_item("uv", uv)?;
            let visual = py.import("trimesh.visual")?.getattr("TextureVisuals")?.call((), Some(&texture))?;
            arguments.set_item("visual", visual)?;
        }
        trimesh.getattr("Trimesh")?.call((), Some(&arguments))
    }

    fn __repr__(&self) -> String {
        format!("<mateval.Mesh {} vertices, {} triangles>", self.0.positions.len(), self.0.triangles.len())
    }
}

/// A scene and the dataset that it belongs to.
pub struct SharedScene {
    pub dataset: Arc<open::Dataset>,
    /// The scene's place in the dataset.
    at: usize,
    /// The instances' meshes, once one of them was read.
    meshes: OnceLock<Vec<Arc<TriangleMesh>>>,
}

impl SharedScene {
    /// The scene at this place of the dataset, which must exist.
    pub fn new(dataset: Arc<open::Dataset>, at: usize) -> Self {
        Self { dataset, at, meshes: OnceLock::new() }
    }

    /// `scene.json`.
    pub fn file(&self) -> &SceneFile {
        &self.dataset.scenes[self.at]
    }

    pub fn folder(&self) -> SceneFolder {
        self.dataset.folder(&self.file().id)
    }

    /// The mesh of an instance by its place in `scene.json`. The first call reads those of all instances.
    pub fn mesh(&self, instance: usize) -> Result<Arc<TriangleMesh>, DatasetError> {
        if let Some(meshes) = self.meshes.get() {
            return Ok(Arc::clone(&meshes[instance]));
        }
        // Reading fails where the file holds other instances than scene.json.
        let surfaces = reference::read_plain(&self.folder(), self.file())?.surfaces;
        let meshes: Vec<Arc<TriangleMesh>> = surfaces.into_iter().map(|surface| Arc::new(surface.mesh)).collect();
        // Two threads may both read; no lock is held meanwhile, which a forked child could wait for.
        Ok(Arc::clone(&self.meshes.get_or_init(|| meshes)[instance]))
    }
}
