//! Chooses scenes among the accepted rooms, so that together they are like the paper's.
//!
//! Rooms are ranked by the score of their best camera. Then one room after another is chosen: each time the one that
//! brings the chosen scenes nearest to the goal, of equally near ones the one with the better rank. How far they are
//! from it is the sum of three terms: the squares of the relative errors of the mean numbers of objects and of
//! super-categories, and for every room type the square of the difference between its share and an equal share. A house
//! gives a limited number of scenes.

use std::collections::BTreeMap;

use mateval_dataset::ids::counted;

use super::survey_file::{Choice, ChosenType, Selection, SurveyedHouse, SurveyedRoom, TargetedMean};

/// What the chosen scenes are to be like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelectionGoal {
    pub scenes: usize,
    /// The most scenes of one house.
    pub per_house: usize,
    /// Mean number of objects of a scene.
    pub objects: f64,
    /// Mean number of different super-categories of a scene's objects.
    pub super_categories: f64,
}

impl SelectionGoal {
    /// This number of scenes, with the means of the paper's Table I.
    pub fn of_paper(scenes: usize, per_house: usize) -> Self {
        Self { scenes, per_house, objects: 13.2, super_categories: 4.3 }
    }
}

#[derive(Clone, Debug)]
struct Candidate {
    /// Index of the house, and of the room in it.
    place: [usize; 2],
    room_type: usize,
    objects: f64,
    super_categories: f64,
}

/// The scenes chosen so far.
#[derive(Clone, Debug)]
struct Chosen {
    count: usize,
    objects: f64,
    super_categories: f64,
    of_type: Vec<usize>,
    of_house: BTreeMap<usize, usize>,
}

/// Ranks the accepted rooms by the score of their best camera, from 1. Of equal scores the room that shows more pieces
/// comes first, then the one whose scene's id does.
pub(super) fn rank(houses: &mut [SurveyedHouse]) {
    let mut ranked: Vec<&mut SurveyedRoom> =
        houses.iter_mut().flat_map(|house| &mut house.rooms).filter(|room| !room.cameras.is_empty()).collect();
    ranked.sort_by(|one, other| {
        let (a, b) = (&one.cameras[0], &other.cameras[0]);
        b.score.total_cmp(&a.score).then(b.seen_objects.cmp(&a.seen_objects)).then(a.scene.cmp(&b.scene))
    });
    ranked.into_iter().enumerate().for_each(|(at, room)| room.rank = Some(at + 1));
}

/// Chooses scenes among the ranked rooms, and notes in each of these whether it was chosen and why.
pub(super) fn select(houses: &mut [SurveyedHouse], goal: &SelectionGoal) -> Selection {
    let types = room_types(houses);
    let candidates = candidates(houses, &types);
    let mut chosen = Chosen {
        count: 0,
        objects: 0.0,
        super_categories: 0.0,
        of_type: vec![0; types.len()],
        of_house: BTreeMap::new(),
    };
    let mut open = candidates.clone();
    while chosen.count < goal.scenes {
        open.retain(|room| chosen.of_house.get(&room.place[0]).is_none_or(|count| *count < goal.per_house));
        let Some(next) = nearest(&open, &chosen, goal) else { break };
        let room = open.remove(next);
        chosen.add(&room);
        let reason = chosen.reason(&room, &types[room.room_type], goal);
        room_at(houses, &room).choice = Some(Choice { place: Some(chosen.count), reason });
    }
    for room in &candidates {
        let full = chosen.of_house.get(&room.place[0]).is_some_and(|count| *count >= goal.per_house);
        let surveyed = room_at(houses, room);
        if surveyed.choice.is_none() {
            let reason = not_chosen(full, goal);
            surveyed.choice = Some(Choice { place: None, reason });
        }
    }
    chosen.summary(&candidates, types, goal)
}

/// The types of all accepted rooms, sorted.
fn room_types(houses: &[SurveyedHouse]) -> Vec<String> {
    let accepted = houses.iter().flat_map(|house| &house.rooms).filter(|room| room.rank.is_some());
    let mut types: Vec<String> = accepted.map(|room| room.room_type.clone()).collect();
    types.sort();
    types.dedup();
    types
}

/// The accepted rooms, the best rank first.
fn candidates(houses: &[SurveyedHouse], types: &[String]) -> Vec<Candidate> {
    let mut found = Vec::new();
    for (house, surveyed) in houses.iter().enumerate() {
        for (at, room) in surveyed.rooms.iter().enumerate() {
            let Some(rank) = room.rank else { continue };
            let room_type = types.binary_search(&room.room_type).expect("the types are those of all accepted rooms");
            let (objects, super_categories) = (room.objects as f64, room.super_categories as f64);
            found.push((rank, Candidate { place: [house, at], room_type, objects, super_categories }));
        }
    }
    found.sort_by_key(|(rank, _)| *rank);
    found.into_iter().map(|(_, room)| room).collect()
}

fn room_at<'a>(houses: &'a mut [SurveyedHouse], room: &Candidate) -> &'a mut SurveyedRoom {
    &mut houses[room.place[0]].rooms[room.place[1]]
}

/// The index of the room that brings the chosen ones nearest to the goal, the first of equally near ones.
fn nearest(open: &[Candidate], chosen: &Chosen, goal: &SelectionGoal) -> Option<usize> {
    let mut best: Option<(usize, f64)> = None;
    for (at, room) in open.iter().enumerate() {
        let distance = chosen.distance_with(room, goal);
        if best.is_none_or(|(_, least)| distance < least) {
            best = Some((at, distance));
        }
    }
    best.map(|(at, _)| at)
}

fn not_chosen(house_is_full: bool, goal: &SelectionGoal) -> String {
    match house_is_full {
        true => format!("its house has given {}, the most of one house", counted(goal.per_house, "scene")),
        false => {
            format!(
                "{} were chosen, and each was nearer to the goal or has a better rank",
                counted(goal.scenes, "scene")
            )
        }
    }
}

impl Chosen {
    /// How far the chosen scenes would be from the goal with this room too.
    fn distance_with(&self, room: &Candidate, goal: &SelectionGoal) -> f64 {
        let count = (self.count + 1) as f64;
        let error = |sum: f64, target: f64| (sum / count / target - 1.0).powi(2);
        let equal = 1.0 / self.of_type.len() as f64;
        let imbalance = |(at, found): (usize, &usize)| {
            let with = *found + usize::from(at == room.room_type);
            (with as f64 / count - equal).powi(2)
        };
        error(self.objects + room.objects, goal.objects)
            + error(self.super_categories + room.super_categories, goal.super_categories)
            + self.of_type.iter().enumerate().map(imbalance).sum::<f64>()
    }

    fn add(&mut self, room: &Candidate) {
        self.count += 1;
        self.objects += room.objects;
        self.super_categories += room.super_categories;
        self.of_type[room.room_type] += 1;
        *self.of_house.entry(room.place[0]).or_insert(0) += 1;
    }

    /// Why the room that was added last was chosen.
    fn reason(&self, room: &Candidate, room_type: &str, goal: &SelectionGoal) -> String {
        let [objects, kinds] = [self.objects, self.super_categories].map(|sum| sum / self.count as f64);
        format!(
            "choice {} of {}: {} objects of {} super-categories; with it the means are {objects:.2} and {kinds:.2}, and {} of \
             {} scenes are a {room_type}",
            self.count, goal.scenes, room.objects, room.super_categories, self.of_type[room.room_type], self.count
        )
    }

    fn summary(&self, candidates: &[Candidate], types: Vec<String>, goal: &SelectionGoal) -> Selection {
        let mean =
            |sum: f64, target: f64| TargetedMean { target, mean: (self.count > 0).then(|| sum / self.count as f64) };
        let of_type = |(at, room_type): (usize, String)| ChosenType {
            room_type,
            candidates: candidates.iter().filter(|room| room.room_type == at).count(),
            chosen: self.of_type[at],
        };
        Selection {
            wanted: goal.scenes,
            candidates: candidates.len(),
            chosen: self.count,
            per_house: goal.per_house,
            objects: mean(self.objects, goal.objects),
            super_categories: mean(self.super_categories, goal.super_categories),
            room_types: types.into_iter().enumerate().map(of_type).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::survey::survey_file::CandidateCamera;

    use super::*;

    fn room(house: usize, room_type: &str, [objects, super_categories]: [usize; 2], score: f64) -> SurveyedRoom {
        let camera = CandidateCamera {
            scene: format!("{room_type}-{house}-{objects}"),
            origin: "seed 1".to_owned(),
            position: [0.0; 3],
            target: [1.0; 3],
            fov_y_deg: 45.0,
            score,
            nearest_m: 1.0,
            outside: 0.0,
            seen_objects: 3,
            thumbnail: String::new(),
        };
        SurveyedRoom {
            room: format!("{room_type}-{house}"),
            room_type: room_type.to_owned(),
            objects,
            super_categories,
            size_m: [4.0, 3.0],
            intersecting: Vec::new(),
            missing: 0,
            rejections: Vec::new(),
            rank: None,
            choice: None,
            cameras: vec![camera],
        }
    }

    fn house(rooms: Vec<SurveyedRoom>) -> SurveyedHouse {
        SurveyedHouse { file: String::new(), uid: None, error: None, findings: Vec::new(), rooms }
    }

    /// Fifty houses, each with a bedroom of few pieces, whose cameras score best, and a living room of many.
    fn houses() -> Vec<SurveyedHouse> {
        let with = |at: usize| {
            let score = 2.0 - at as f64 / 100.0;
            let bedroom = room(at, "Bedroom", [4 + at % 5, 3], score);
            let living = room(at, "LivingRoom", [10 + at % 12, 4 + at % 3], score - 0.7);
            house(vec![bedroom, living])
        };
        let mut houses: Vec<SurveyedHouse> = (0..50).map(with).collect();
        rank(&mut houses);
        houses
    }

    fn chosen(houses: &[SurveyedHouse]) -> Vec<&SurveyedRoom> {
        let rooms = houses.iter().flat_map(|house| &house.rooms);
        rooms.filter(|room| room.choice.as_ref().is_some_and(|choice| choice.place.is_some())).collect()
    }

    fn mean_objects(rooms: &[&SurveyedRoom]) -> f64 {
        rooms.iter().map(|room| room.objects as f64).sum::<f64>() / rooms.len() as f64
    }

    #[test]
    fn ranks_go_by_score() {
        let mut ranked = houses();
        ranked.iter_mut().flat_map(|house| &mut house.rooms).for_each(|room| room.cameras.truncate(1));
        assert_eq!(ranked[0].rooms.iter().map(|room| room.rank).collect::<Vec<_>>(), [Some(1), Some(51)]);
        let mut empty = vec![house(vec![room(0, "Bedroom", [4, 3], 1.0)])];
        empty[0].rooms[0].cameras.clear();
        rank(&mut empty);
        assert_eq!(empty[0].rooms[0].rank, None);
    }

    #[test]
    fn a_choice_is_nearer_to_the_goal_than_the_best_ranks() {
        let goal = SelectionGoal::of_paper(20, 1);
        let mut houses = houses();
        let selection = select(&mut houses, &goal);
        assert_eq!((selection.wanted, selection.candidates, selection.chosen), (20, 100, 20));
        let mean = selection.objects.mean.unwrap();
        assert_eq!(mean, mean_objects(&chosen(&houses)));
        let mut by_rank: Vec<&SurveyedRoom> = houses.iter().flat_map(|house| &house.rooms).collect();
        by_rank.sort_by_key(|room| room.rank);
        let first = mean_objects(&by_rank[..20]);
        assert!((mean - 13.2).abs() < 0.7 && (first - 13.2).abs() > 5.0, "{mean}, {first}");
        assert!((selection.super_categories.mean.unwrap() - 4.3).abs() < 0.3);
        let of_type: Vec<usize> = selection.room_types.iter().map(|found| found.chosen).collect();
        assert!(of_type.iter().all(|count| (7..=13).contains(count)), "{of_type:?}");
        // One scene a house at most.
        assert!(houses.iter().all(|house| chosen(std::slice::from_ref(house)).len() <= 1));
        // Every room has a reason, and places are 1 to 20.
        let rooms = houses.iter().flat_map(|house| &house.rooms);
        let mut places: Vec<usize> = rooms.filter_map(|room| room.choice.as_ref().unwrap().place).collect();
        places.sort();
        assert_eq!(places, (1..=20).collect::<Vec<_>>());
    }

    #[test]
    fn the_order_of_the_houses_does_not_matter() {
        let goal = SelectionGoal::of_paper(15, 1);
        let ids = |mut houses: Vec<SurveyedHouse>| {
            select(&mut houses, &goal);
            let mut ids: Vec<(Option<usize>, String)> =
                chosen(&houses).iter().map(|room| (room.choice.as_ref().unwrap().place, room.room.clone())).collect();
            ids.sort();
            ids
        };
        let mut reversed = houses();
        reversed.reverse();
        assert_eq!(ids(houses()), ids(reversed));
    }

    #[test]
    fn fewer_candidates_than_scenes_and_none() {
        let mut three: Vec<SurveyedHouse> = houses().drain(..3).collect();
        let selection = select(&mut three, &SelectionGoal::of_paper(5, 1));
        assert_eq!((selection.chosen, selection.candidates), (3, 6));
        let left = three.iter().flat_map(|house| &house.rooms).filter_map(|room| room.choice.as_ref());
        let reasons: Vec<&str> = left.filter(|c| c.place.is_none()).map(|c| c.reason.as_str()).collect();
        assert_eq!(reasons, ["its house has given 1 scene, the most of one house"; 3]);
        let selection = select(&mut [], &SelectionGoal::of_paper(5, 1));
        assert_eq!((selection.chosen, selection.objects.mean), (0, None));
    }
}
