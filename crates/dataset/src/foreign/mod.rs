//! Reads untrusted files of formats that are not ours: glTF and OBJ, with their materials.

pub mod gltf_file;
pub mod obj;
pub mod specular_glossiness;
