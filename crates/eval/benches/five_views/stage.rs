//! The time of a stage.

use std::time::Instant;

use cpu_time::ProcessTime;

use crate::Run;

/// CPU seconds of all threads and wall seconds of one stage.
#[derive(Clone, Debug)]
pub struct Stage {
    pub name: String,
    pub samples: u32,
    /// Iterations of an optimiser; 0 without one.
    pub iterations: u32,
    pub cpu: f64,
    pub wall: f64,
}

impl Stage {
    /// Does `work` and measures its time.
    pub fn measure<T>(name: &str, samples: u32, work: impl FnOnce() -> T) -> (T, Self) {
        let (cpu, wall) = (ProcessTime::now(), Instant::now());
        let done = work();
        let (cpu, wall) = (cpu.elapsed().as_secs_f64(), wall.elapsed().as_secs_f64());
        (done, Self { name: name.to_owned(), samples, iterations: 0, cpu, wall })
    }

    /// The mean over all runs of the stage with this name and number of samples.
    pub fn mean(runs: &[Run], name: &str, samples: u32) -> Self {
        let found: Vec<&Self> = runs.iter().filter_map(|run| find(&run.stages, name, Some(samples))).collect();
        let sum = found[1..].iter().fold(found[0].clone(), |sum, stage| sum.plus(stage));
        sum.times(1.0 / found.len() as f64)
    }

    pub fn times(&self, factor: f64) -> Self {
        Self { cpu: self.cpu * factor, wall: self.wall * factor, ..self.clone() }
    }

    pub fn plus(&self, other: &Self) -> Self {
        Self { cpu: self.cpu + other.cpu, wall: self.wall + other.wall, ..self.clone() }
    }

    /// The time for another number of iterations.
    pub fn scaled_to_iterations(&self, iterations: u32) -> Self {
        self.times(f64::from(iterations) / f64::from(self.iterations))
    }
}

/// The stage with this name, and with this number of samples if one is given.
pub fn find<'a>(stages: &'a [Stage], name: &str, samples: Option<u32>) -> Option<&'a Stage> {
    stages.iter().find(|stage| stage.name == name && samples.is_none_or(|samples| stage.samples == samples))
}
