//! Interleaved timing: load on the machine hits all contestants alike.
#![allow(dead_code, reason = "benchmarks share it, and not each uses all")]

use cpu_time::ProcessTime;

/// One contestant: its name and a run of it.
pub type Contestant<'a> = (&'a str, Box<dyn FnMut() + 'a>);

/// CPU seconds of every run, contestant by contestant; each round runs all of them once, after one round to warm up.
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

/// The middle one.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// The median over rounds of how many times faster the second was than the first.
pub fn speedup(first: &[f64], second: &[f64]) -> f64 {
    median(&first.iter().zip(second).map(|(first, second)| first / second).collect::<Vec<_>>())
}
