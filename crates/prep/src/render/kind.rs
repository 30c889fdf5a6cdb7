//! The renderers of a dataset's pictures: their names, in one place that prints and parses them.

use std::str::FromStr;

use mateval_scene::RendererId;

/// A renderer, by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RendererKind {
    /// Blender's Cycles.
    Blender,
    /// MatEval's own path tracer.
    Builtin,
}

impl RendererKind {
    /// Every renderer. The first one that has rendered all views of a dataset makes its input pictures.
    pub const ALL: [Self; 2] = [Self::Blender, Self::Builtin];

    /// The renderer's name: on the command line, in `render.json`, and of the folder that holds its pictures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Blender => "blender",
            Self::Builtin => "builtin",
        }
    }

    /// What the renderer is, in one sentence for a help text.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Blender => "Blender's Cycles: denoised, and each light group in pictures of its own",
            Self::Builtin => "The built-in path tracer",
        }
    }

    /// The name as a dataset's files hold it.
    pub fn id(self) -> RendererId {
        RendererId::new(self.name()).expect("every renderer's name is a valid id")
    }
}

impl std::fmt::Display for RendererKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that no renderer has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{name}' is not a renderer; expected one of: {}", RendererKind::ALL.map(RendererKind::name).join(", "))]
pub struct UnknownRenderer {
    /// The name.
    pub name: String,
}

impl FromStr for RendererKind {
    type Err = UnknownRenderer;

    fn from_str(name: &str) -> Result<Self, UnknownRenderer> {
        let found = Self::ALL.into_iter().find(|kind| kind.name() == name);
        found.ok_or_else(|| UnknownRenderer { name: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_parses_back_and_is_an_id() {
        for kind in RendererKind::ALL {
            assert_eq!(kind.to_string().parse(), Ok(kind));
            assert_eq!(kind.id().as_str(), kind.name());
        }
        let unknown = "povray".parse::<RendererKind>().unwrap_err();
        assert_eq!(unknown.to_string(), "'povray' is not a renderer; expected one of: blender, builtin");
    }
}
