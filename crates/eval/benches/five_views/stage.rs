//! How long a stage took.

use std::time::Instant;

use crate::Run;

/// CPU seconds of all threads and wall seconds of one stage.
#[derive(Clone, Debug)]
pub struct Stage {
    pub name: String,
    pub samples: u32,
    /// Of an optimiser; 0 where there is none.
    pub iterations: u32,
    pub cpu: f64,
    pub wall: f64,
}

impl Stage {
    /// Does `work` and tells what it took.
    pub fn measure<T>(name: &str, samples: u32, work: impl FnOnce() -> T) -> (T, Self) {
        let (cpu, wall) = (cpu_seconds(), Instant::now());
        let done = work();
        let (cpu, wall) = (cpu_seconds() - cpu, wall.elapsed().as_secs_f64());
        (done, Self { name: name.to_owned(), samples, iterations: 0, cpu, wall })
    }

    /// The mean of all runs' stages of that name and number of samples.
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

    /// What more iterations, or fewer, would take.
    pub fn scaled_to_iterations(&self, iterations: u32) -> Self {
        self.times(f64::from(iterations) / f64::from(self.iterations))
    }
}

/// The stage of that name, and of that number of samples if one is given.
pub fn find<'a>(stages: &'a [Stage], name: &str, samples: Option<u32>) -> Option<&'a Stage> {
    stages.iter().find(|stage| stage.name == name && samples.is_none_or(|samples| stage.samples == samples))
}

/// Of this process, all threads, from Linux' `/proc`, in ticks of 10 ms; not a number elsewhere.
fn cpu_seconds() -> f64 {
    let ticks = |text: String| {
        // The second field is the command in brackets and may hold spaces; times are fields 14 and 15.
        let rest = text.rsplit(')').next()?.split_whitespace().skip(11).take(2);
        rest.map(|field| field.parse::<f64>().ok()).sum::<Option<f64>>()
    };
    std::fs::read_to_string("/proc/self/stat").ok().and_then(ticks).map_or(f64::NAN, |ticks| ticks / 100.0)
}
