//! The role of an instance in its scene, the kind of source of a scene, and whose lights its fitted light uses.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

/// The role of an instance in its scene. The reader of the source states it, since only the source knows it.
// Variants without fields have braces, with which serde refuses unknown fields.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Role {
    /// A wall, a floor or another fixed surface of the building.
    Architecture {
        /// The source's type of mesh, as in `WallInner`.
        kind: String,
    },
    /// A piece of furniture that gives no light.
    Furniture {},
    /// A piece of furniture that gives light, such as a lamp.
    LightFixture {},
    /// Any other object, and every object of a source that does not state roles.
    Other {},
}

/// A source that does not state roles leaves them at this one.
impl Default for Role {
    fn default() -> Self {
        Self::Other {}
    }
}

impl Role {
    /// Whether the instance belongs to the building.
    pub fn is_architecture(&self) -> bool {
        matches!(self, Self::Architecture { .. })
    }

    /// Whether the instance is furniture, with or without light.
    pub fn is_furniture(&self) -> bool {
        matches!(self, Self::Furniture {} | Self::LightFixture {})
    }

    /// Whether the instance is a ceiling, by the source's type of mesh.
    pub fn is_ceiling(&self) -> bool {
        self.architecture_kind().is_some_and(|kind| kind.to_lowercase().contains("ceiling"))
    }

    /// The source's type of mesh, where the instance belongs to the building.
    pub fn architecture_kind(&self) -> Option<&str> {
        match self {
            Self::Architecture { kind } => Some(kind),
            _ => None,
        }
    }
}

/// The kind of source that a scene came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SourceKind {
    /// One of Bitterli's scenes, as Mitsuba XML.
    Bitterli,
    /// A room of a 3D-FRONT house.
    Front3d,
    /// A glTF file.
    Gltf,
    /// A Blender file, which Blender baked.
    Blend,
}

impl fmt::Display for SourceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bitterli => "bitterli",
            Self::Front3d => "front3d",
            Self::Gltf => "gltf",
            Self::Blend => "blend",
        })
    }
}

// The words are listed once, in `dataset_spec/FORMAT.md`, so that a new source changes no schema.
impl JsonSchema for SourceKind {
    fn schema_name() -> Cow<'static, str> {
        "SourceKind".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "The kind of source that a scene came from; FORMAT.md lists the words.",
            "type": "string",
            "pattern": "^[a-z0-9_]+$"
        })
    }
}

/// The lights whose radiances are fitted to the input view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SceneLights {
    /// The scene's own lights, which the source describes.
    Own,
    /// A light stage, since the source does not describe the scene's lights.
    Stage,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_have_one_spelling() {
        let wall = Role::Architecture { kind: "WallInner".to_owned() };
        let spellings = [
            (wall, r#"{"type":"architecture","kind":"WallInner"}"#),
            (Role::Furniture {}, r#"{"type":"furniture"}"#),
            (Role::LightFixture {}, r#"{"type":"light_fixture"}"#),
            (Role::Other {}, r#"{"type":"other"}"#),
        ];
        for (role, text) in spellings {
            assert_eq!(serde_json::to_string(&role).unwrap(), text);
            assert_eq!(serde_json::from_str::<Role>(text).unwrap(), role);
        }
        for unknown in [r#"{"type":"wall"}"#, r#"{"type":"architecture"}"#, r#"{"type":"furniture","kind":"Bed"}"#] {
            assert!(serde_json::from_str::<Role>(unknown).is_err(), "{unknown}");
        }
    }

    #[test]
    fn kinds_print_as_they_are_written() {
        for kind in [SourceKind::Bitterli, SourceKind::Front3d, SourceKind::Gltf, SourceKind::Blend] {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.to_string());
        }
    }
}
