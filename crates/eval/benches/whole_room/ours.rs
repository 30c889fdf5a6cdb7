//! Scores the room with this project.

use std::sync::Mutex;
use std::time::Instant;

use cpu_time::ProcessTime;
use mateval_eval::result::ResultFile;
use mateval_eval::score::{LpipsWeights, ScorePlan, score as score_plan};
use mateval_metrics::{Lpips, Net};
use mateval_scene::Report;
use mateval_scene::open::Dataset;

use crate::Run;
use crate::room::Room;
use crate::stage::Stage;

/// Scores the submission in the room; every step whose progress scoring reports is a stage.
pub fn score(room: &Room) -> (Run, ResultFile) {
    let clock = Clock::start();
    let dataset = Dataset::open(&room.dataset).unwrap();
    let lpips = match &room.weights {
        Some(path) => LpipsWeights::Loaded(Box::new(Lpips::load(Net::Alex, path).unwrap())),
        None => panic!("MATEVAL_CACHE names no folder with the weights of LPIPS"),
    };
    let plan = ScorePlan {
        dataset: &dataset,
        submissions: vec![&room.submission],
        protocols: vec![room.protocol.clone()],
        scenes: vec![room.scene.id.clone()],
        lpips,
        tool: "whole_room".to_owned(),
        jobs: 1,
        cache: None,
        only_cached: false,
        companion_cache: None,
    };
    let prefix = format!("scene {}: ", room.scene.id);
    let report = |report: Report<'_>| {
        let Report::Step { name, done, total } = report else { return };
        let step = name.strip_prefix(&prefix).unwrap_or(name);
        // After a finished step follows work that reports no progress.
        clock.enter(&if done < total { step.to_owned() } else { format!("after {step}") });
    };
    let result = score_plan(&plan, &report).unwrap().remove(0);
    (Run { stages: clock.stop(), pictures: Default::default() }, result)
}

/// Measures the stages of work that reports its current step.
struct Clock(Mutex<Times>);

struct Times {
    stages: Vec<Stage>,
    name: String,
    since: (ProcessTime, Instant),
}

impl Clock {
    fn start() -> Self {
        let since = (ProcessTime::now(), Instant::now());
        Self(Mutex::new(Times { stages: Vec::new(), name: "reading".to_owned(), since }))
    }

    fn enter(&self, name: &str) {
        let mut times = self.0.lock().unwrap();
        // Tiles may report out of order: a finished step stays finished.
        if times.name != name && times.name != format!("after {name}") {
            times.close();
            name.clone_into(&mut times.name);
        }
    }

    fn stop(self) -> Vec<Stage> {
        let mut times = self.0.into_inner().unwrap();
        times.close();
        times.stages
    }
}

impl Times {
    fn close(&mut self) {
        let (cpu, wall) = (self.since.0.elapsed().as_secs_f64(), self.since.1.elapsed().as_secs_f64());
        self.since = (ProcessTime::now(), Instant::now());
        self.stages.push(Stage { name: self.name.clone(), samples: 0, iterations: 0, cpu, wall });
    }
}
