//! Interleaved timing, so that other load on the machine affects all contestants alike.
#![allow(dead_code, reason = "benchmarks share it, and not each uses all")]

use cpu_time::ProcessTime;

/// A contestant: a name and a function that runs it.
pub type Contestant<'a> = (&'a str, Box<dyn FnMut() + 'a>);

/// Runs all contestants once per round, after one round to warm up, and returns the CPU seconds of every run per
/// contestant.
pub fn interleaved(rounds: usize, contestants: &mut [Contestant]) -> Vec<Vec<f64>> {
    let mut seconds = vec![Vec::new(); contestants.len()];
    for round in 0..=rounds {
        for (which, (_, run)) in contestants.iter_mut().enumerate() {
            let start = ProcessTime::now();
            run();
            let elapsed = start.elapsed().as_secs_f64();
            if round > 0 {
                seconds[which].push(elapsed);
            }
        }
    }
    seconds
}

/// The median.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// The median over rounds of the first contestant's time over the second's.
pub fn speedup(first: &[f64], second: &[f64]) -> f64 {
    median(&first.iter().zip(second).map(|(first, second)| first / second).collect::<Vec<_>>())
}
