//! The rules that drawn cameras keep, and the named sets of them.

use mateval_dataset::word_enum;

word_enum! {
    /// A named set of rules for drawn cameras.
    #[derive(Default)]
    CameraRules, a "set of camera rules":
    /// Those of BlenderProc's 3D-FRONT examples. In rooms of later releases, which are open to other rooms and full of
    /// furniture, often no camera keeps them.
    #[default]
    BlenderProc = "blenderproc",
    /// Those of the fork of BlenderProc that the paper's lab (3dlg-hcvc) published: no distances, a score of its
    /// own that ignores the architecture, and the best of three times as many cameras.
    ThreeDlg = "3dlg",
}

impl CameraRules {
    /// What the set is, in one sentence for a help text.
    pub fn summary(self) -> &'static str {
        match self {
            Self::BlenderProc => {
                "BlenderProc's 3D-FRONT examples: nothing within 1 m, mean distance 2.5 to 3.5 m, score above 0.8"
            }
            Self::ThreeDlg => {
                "The fork by the paper's lab: 480x360, 90 degrees wide, score from 0.5, no distances, views by floor area, \
                 the best of three draws"
            }
        }
    }

    /// The rules of one draw.
    pub fn sampler_rules(self) -> SamplerRules {
        match self {
            Self::BlenderProc => SamplerRules::default(),
            Self::ThreeDlg => SamplerRules {
                min_distance_m: 0.0,
                mean_distance_m: [0.0, f64::INFINITY],
                no_background: false,
                architecture_weight: 0,
                coverage: Coverage::EntropyOfInstances,
                min_score: 0.5,
                ..SamplerRules::default()
            },
        }
    }

    /// How many cameras are drawn for each that is kept.
    pub fn draws_for_each(self) -> u32 {
        match self {
            Self::BlenderProc => 1,
            Self::ThreeDlg => 3,
        }
    }

    /// Number of cameras of a room. `a_room` is the mean over the house's `rooms`, and `share` the room's part of the
    /// house's floor area, 0 to 1.
    pub fn cameras_of_room(self, a_room: u32, rooms: usize, share: f64) -> u32 {
        match self {
            Self::BlenderProc => a_room,
            Self::ThreeDlg => (f64::from(a_room) * rooms as f64 * share).ceil() as u32,
        }
    }

    /// Width and height of pictures in pixels, where nothing else is asked for.
    pub fn resolution(self) -> [u32; 2] {
        match self {
            Self::BlenderProc => [480, 270],
            Self::ThreeDlg => [480, 360],
        }
    }

    /// Vertical field of view in degrees, where nothing else is asked for.
    pub fn fov_y_deg(self) -> f64 {
        match self {
            Self::BlenderProc => 45.0,
            // 2 atan(360 / 480): 90 degrees wide.
            Self::ThreeDlg => 73.739_795_291_688_04,
        }
    }
}

/// How the variety of what a camera sees enters its score.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coverage {
    Kinds,
    EntropyOfInstances,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplerRules {
    /// Range of the height above the floor, in metres.
    pub height_m: [f64; 2],
    /// Range of the pitch below the horizon, in degrees.
    pub pitch_down_deg: [f64; 2],
    /// The least distance to anything seen in any view, in metres; 0 for any.
    pub min_distance_m: f64,
    /// The least distance to anything in any direction, in metres. No set of BlenderProc's has such a rule; without it
    /// cameras stand in furniture.
    pub clearance_m: f64,
    /// Range of the mean distance in the input view, in metres.
    pub mean_distance_m: [f64; 2],
    /// Whether no view may see the outside.
    pub no_background: bool,
    /// The weight of walls, floors and the like in the score; other things weigh 1 or 10.
    pub architecture_weight: u32,
    pub coverage: Coverage,
    pub min_score: f64,
    /// The largest number of draws.
    pub tries: u32,
}

impl Default for SamplerRules {
    /// BlenderProc's.
    fn default() -> Self {
        Self {
            height_m: [1.4, 1.8],
            // In BlenderProc 1.2217 to 1.338 rad, measured from straight down.
            pitch_down_deg: [13.34, 20.0],
            min_distance_m: 1.0,
            clearance_m: 0.3,
            mean_distance_m: [2.5, 3.5],
            no_background: true,
            architecture_weight: 1,
            coverage: Coverage::Kinds,
            min_score: 0.8,
            tries: 10_000,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back_and_others_are_refused() {
        for &rules in CameraRules::ALL {
            assert_eq!(rules.word().parse(), Ok(rules));
        }
        let text = "3DLG".parse::<CameraRules>().unwrap_err().to_string();
        assert!(text.ends_with("expected one of: blenderproc, 3dlg"), "{text}");
    }

    /// A house of 60 m2 in three rooms, four cameras a room on average: ceil(12 * share), as the fork rounds.
    #[test]
    fn the_fork_gives_large_rooms_more_cameras() {
        let of_fork = [30.0, 21.0, 9.0].map(|area| CameraRules::ThreeDlg.cameras_of_room(4, 3, area / 60.0));
        assert_eq!(of_fork, [6, 5, 2]);
        assert_eq!(CameraRules::ThreeDlg.cameras_of_room(4, 3, 0.0), 0);
        assert_eq!(CameraRules::BlenderProc.cameras_of_room(4, 3, 0.1), 4);
    }

    #[test]
    fn the_forks_view_is_ninety_degrees_wide() {
        let [width, height] = CameraRules::ThreeDlg.resolution().map(f64::from);
        let half = (CameraRules::ThreeDlg.fov_y_deg() / 2.0).to_radians();
        assert!((half.tan() * width / height - 1.0).abs() < 1e-12);
    }
}
