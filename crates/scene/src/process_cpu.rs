//! The processor time that this process and its ended child processes have used.

use std::time::Duration;

/// Where Linux states it; see proc(5).
const STAT: &str = "/proc/self/stat";

/// The places of `utime`, `stime`, `cutime` and `cstime` behind the program's name.
const TIMES: std::ops::Range<usize> = 11..15;

/// The processor time used so far, of all threads and of child processes that have ended; none where the system does not
/// state it.
pub fn used() -> Option<Duration> {
    let ticks = ticks(&std::fs::read_to_string(STAT).ok()?)?;
    Some(Duration::from_secs_f64(ticks as f64 / rustix::param::clock_ticks_per_second() as f64))
}

/// The sum of the four times, in clock ticks. The program's name is in parentheses and may contain any character.
fn ticks(stat: &str) -> Option<u64> {
    let (_, rest) = stat.rsplit_once(") ")?;
    let fields: Vec<&str> = rest.split_whitespace().collect();
    fields.get(TIMES)?.iter().map(|field| field.parse::<u64>().ok()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_times_are_summed_whatever_the_name() {
        let stat = "12 (a) b) R 1 2 3 4 5 6 7 8 9 10 100 20 3000 4 0 0";
        assert_eq!(ticks(stat), Some(3124));
        assert_eq!(ticks("12 (a) R 1 2 3"), None);
        assert_eq!(ticks(&stat.replace("3000", "x")), None);
    }

    #[test]
    fn time_passes() {
        let before = used().unwrap();
        while used().unwrap() == before {}
    }
}
