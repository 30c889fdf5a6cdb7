//! The two sets of views that are scored apart, so that the one never changes the numbers of the other.

use mateval_scene::dataset::View;
use mateval_scene::layout::INPUT;

/// A set of views that are rendered together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ViewSet {
    /// The input view, and those that are it turned.
    Turned,
    /// Views from other places. The input view comes with them, since lights and companions are judged by it; its numbers
    /// are those of the other set.
    Wide,
}

impl ViewSet {
    /// The views of the set; empty where there are none.
    pub(crate) fn of<'a>(self, views: &[&'a View]) -> Vec<&'a View> {
        let is_wanted = |view: &&&View| match self {
            Self::Turned => !view.id.is_wide(),
            Self::Wide => view.id.is_wide() || view.id.as_str() == INPUT,
        };
        let chosen: Vec<&View> = views.iter().filter(is_wanted).copied().collect();
        let has_own = self == Self::Turned || chosen.iter().any(|view| view.id.is_wide());
        if has_own { chosen } else { Vec::new() }
    }

    /// The name of a pass over the set: part of its seeds, and the folder of its companions.
    pub(crate) fn pass(self, name: PassName) -> &'static str {
        match (name, self) {
            (PassName::Own, Self::Turned) => "own",
            (PassName::Own, Self::Wide) => "own_wide",
            (PassName::Fitted, Self::Turned) => "fitted",
            (PassName::Fitted, Self::Wide) => "fitted_wide",
            (PassName::Stage, Self::Turned) => "stage",
            (PassName::Stage, Self::Wide) => "stage_wide",
        }
    }
}

/// What a pass renders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PassName {
    /// The scene's own lights under known weights.
    Own,
    /// The scene's own lights under fitted weights.
    Fitted,
    /// The lights of a stage under fitted weights.
    Stage,
}
