//! What people say of a board's pictures: files of votes, as its page `votes.html` saves them, become a strength for
//! each method, and the rank correlation of each headline number with these strengths.
//!
//! Strengths are those of Bradley and Terry ("Rank analysis of incomplete block designs", 1952): method a is closer to
//! the truth than b with probability w_a / (w_a + w_b), and a strength is ln w. "Equally close" counts as half a vote
//! for either. Votes of one person are alike, so that intervals come from draws of whole voters.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use mateval_dataset::progress::{Table, row};
use mateval_dataset::{Finding, SceneId, Severity, json};
use mateval_eval::protocol::Protocol;
use mateval_eval::result::ResultFile;
use mateval_eval::result::key::ResultKey;
use mateval_files::untrusted::shortened;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{ReportError, fitting};
use crate::ranking::file::{RankedMethod, Ranking};
use crate::ranking::{Draws, kendall_tau_b, rank, tails};

/// The format of this version of votes.
pub const VOTES_FORMAT: &str = "mateval-votes/1";

/// The format of this version of what votes say.
pub const PREFERENCES_FORMAT: &str = "mateval-preferences/1";

const SEED: u64 = 0;

const DRAWS: usize = 2000;

/// With fewer voters, too many draws hold a single one, as with [houses](crate::ranking).
const LEAST_VOTERS: usize = 5;

/// Ties that each method is given besides its votes, spread over all others. Without them there is no finite maximum if
/// some methods were never preferred to the others (Ford 1957), as happens in draws of few voters.
const GIVEN_TIES: f64 = 1.0;

/// What to do with a file that cannot be counted.
const UNFIT: &str = "correct it, or leave it out: files of votes are those that votes.html of this board saves";

/// The votes of one sitting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VotesFile {
    /// Always `mateval-votes/1`.
    pub format: String,
    /// The tool that wrote the board, as in `mateval 0.1.0`.
    pub tool: String,
    /// The protocol of the board.
    pub protocol: String,
    /// The fingerprint of the board.
    pub fingerprint: String,
    /// The methods whose pictures were shown.
    pub methods: Vec<VotedMethod>,
    /// Who voted. Files with the same voter hold votes of one person.
    pub voter: String,
    /// A random text for each time that the page is opened. Two files of one sitting hold the same votes.
    pub sitting: String,
    /// In the order in which they were cast.
    pub votes: Vec<Vote>,
}

/// A method that was voted on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VotedMethod {
    /// Its id on the board.
    pub id: String,
    /// Its name.
    pub method: String,
    /// The hash of its submission.
    pub submission_sha256: String,
}

/// One comparison: which of two pictures is closer to the truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Vote {
    /// The scene.
    pub scene: SceneId,
    /// The view.
    pub view: String,
    /// The kind of picture, as in `albedo`.
    pub picture: String,
    /// The id of the method whose picture was on the left.
    pub left: String,
    /// The id of the method whose picture was on the right.
    pub right: String,
    /// Which of them is closer to the truth.
    pub choice: Closer,
    /// From when the pictures were shown until the choice.
    pub seconds: f64,
}

/// Which picture is closer to the truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Closer {
    /// That on the left.
    Left,
    /// That on the right.
    Right,
    /// Neither.
    Equal,
}

/// What all votes say together.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Preferences {
    /// Always `mateval-preferences/1`.
    pub format: String,
    /// The tool that counted, as in `mateval 0.1.0`.
    pub tool: String,
    /// The protocol of the board.
    pub protocol: String,
    /// The fingerprint of the board.
    pub fingerprint: String,
    /// The number of people who voted.
    pub voters: usize,
    /// The number of their votes.
    pub votes: usize,
    /// The number of draws of voters behind each interval.
    pub draws: usize,
    /// The seed of these draws.
    pub seed: u64,
    /// All methods of the board, the strongest first, those without votes last.
    pub methods: Vec<MethodStrength>,
    /// The headline numbers, the one that orders methods most as people do first.
    pub numbers: Vec<Predictor>,
}

/// How often people prefer a method.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MethodStrength {
    /// Its id on the board.
    pub id: String,
    /// Its name.
    pub method: String,
    /// The number of votes on it.
    pub votes: usize,
    /// The number of votes for it; ties count half.
    pub wins: f64,
    /// Natural logarithm of the odds that its picture is preferred to one of a method of mean strength; null without
    /// votes.
    pub strength: Option<f64>,
    /// Null without votes, or with too few voters.
    pub interval: Option<VoterInterval>,
}

/// How much the order of methods by a number is that by people's votes.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Predictor {
    /// The number.
    pub key: ResultKey,
    /// The number of methods that have both votes and this number.
    pub methods: usize,
    /// Kendall's tau-b, 1 if the orders are the same, better numbers being those of stronger methods; null if there are
    /// no two different methods.
    pub tau_b: Option<f64>,
    /// Null without a tau, or with too few voters. Of voters alone: the scenes are taken as given.
    pub interval: Option<VoterInterval>,
}

/// The interval that holds, with 95 % confidence, the value that all people of the kind that voted would give.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct VoterInterval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Counts the votes in the files about the board that these results make. Fails with every reason for which files
/// cannot be counted: they are something else, or about another board.
pub fn preferences(
    paths: &[PathBuf],
    results: &[ResultFile],
    partial: bool,
    tool: &str,
) -> Result<Preferences, ReportError> {
    let (mut files, mut findings) = (Vec::new(), Vec::new());
    for path in paths {
        let file = json::read_format::<VotesFile>(path, VOTES_FORMAT);
        files.extend(fitting(file, "votes", path, UNFIT, &mut findings)?.map(|file| (path.as_path(), file)));
    }
    if files.is_empty() && !findings.is_empty() {
        return Err(ReportError::UnfitVotes(findings));
    }
    let protocol = files.first().map_or(Protocol::DEFAULT, |(_, file)| &file.protocol);
    let ranking = rank(results, protocol, partial)?;
    let mut sittings: BTreeMap<&str, &Path> = BTreeMap::new();
    let mut voters: BTreeMap<&str, Tally> = BTreeMap::new();
    for &(path, ref file) in &files {
        let before = findings.len();
        findings.extend(faults(path, file, &ranking));
        if let Some(other) = sittings.insert(&file.sitting, path) {
            let message = format!("'{}' holds votes of the same sitting", other.display());
            findings.push(fault("repeated_votes", path, "/sitting", message, "leave out the one with fewer votes"));
        }
        if findings.len() == before {
            let tally = voters.entry(file.voter.trim()).or_insert_with(|| Tally::new(ranking.methods.len()));
            file.votes.iter().for_each(|vote| tally.count(vote, file, &ranking));
        }
    }
    if !findings.is_empty() {
        return Err(ReportError::UnfitVotes(findings));
    }
    let voters: Vec<Tally> = voters.into_values().collect();
    // The ranking has refused an empty list.
    let headline = results.first().and_then(|result| result.protocols.get(&ranking.protocol));
    let headline = headline.map_or(&[][..], |scores| &scores.protocol.headline);
    let counted = Counted::new(&voters, ranking.methods.len());
    let (methods, numbers) = (counted.methods(&ranking), counted.numbers(headline, &ranking));
    Ok(Preferences {
        format: PREFERENCES_FORMAT.to_owned(),
        tool: tool.to_owned(),
        protocol: ranking.protocol,
        fingerprint: ranking.fingerprint,
        voters: voters.len(),
        votes: voters.iter().map(|tally| tally.votes.iter().sum::<usize>() / 2).sum(),
        draws: DRAWS,
        seed: SEED,
        methods,
        numbers,
    })
}

fn fault(code: &'static str, path: &Path, place: &str, message: String, action: &str) -> Finding {
    Finding::new(Severity::Error, code, path.display().to_string(), place.to_owned(), message, action)
}

/// Why the votes in a file cannot be counted: a file about another board has no further faults.
fn faults(path: &Path, file: &VotesFile, ranking: &Ranking) -> Vec<Finding> {
    if file.fingerprint != ranking.fingerprint {
        let found = shortened(&file.fingerprint);
        let message =
            format!("these are votes on the board '{found}', but the results make the board '{}'", ranking.fingerprint);
        let action = "give all results of the board that was voted on, or leave these votes out";
        return vec![fault("other_board", path, "/fingerprint", message, action)];
    }
    let unknown = file.methods.iter().enumerate().filter(|(_, method)| place(method, ranking).is_none());
    let mut faults: Vec<Finding> = unknown
        .map(|(at, method)| {
            let name = shortened(&method.method);
            let message = format!("no result is of the method '{name}' with the submission that was voted on");
            let place = format!("/methods/{at}");
            fault("unknown_method", path, &place, message, "add its result as --result, unchanged since the votes")
        })
        .collect();
    let ids: BTreeSet<&str> = file.methods.iter().map(|method| method.id.as_str()).collect();
    let is_bad =
        |vote: &Vote| vote.left == vote.right || ![&vote.left, &vote.right].iter().all(|id| ids.contains(id.as_str()));
    faults.extend(file.votes.iter().position(is_bad).map(|at| {
        let message = "expected a vote between two of the file's methods".to_owned();
        fault("bad_vote", path, &format!("/votes/{at}"), message, UNFIT)
    }));
    faults
}

/// The place of a method in the ranking.
fn place(method: &VotedMethod, ranking: &Ranking) -> Option<usize> {
    let is_it =
        |other: &RankedMethod| other.method == method.method && other.submission_sha256 == method.submission_sha256;
    ranking.methods.iter().position(is_it)
}

/// The votes of one voter, or the sum of several.
#[derive(Clone, Debug, PartialEq)]
struct Tally {
    /// By method.
    votes: Vec<usize>,
    /// Row by row, how often the method of the row was preferred to that of the column.
    wins: Vec<f64>,
}

impl Tally {
    fn new(methods: usize) -> Self {
        Self { votes: vec![0; methods], wins: vec![0.0; methods * methods] }
    }

    fn count(&mut self, vote: &Vote, file: &VotesFile, ranking: &Ranking) {
        let at = |id: &str| place(file.methods.iter().find(|method| method.id == id)?, ranking);
        let (Some(left), Some(right)) = (at(&vote.left), at(&vote.right)) else { return };
        let share = match vote.choice {
            Closer::Left => 1.0,
            Closer::Equal => 0.5,
            Closer::Right => 0.0,
        };
        let methods = self.votes.len();
        self.wins[left * methods + right] += share;
        self.wins[right * methods + left] += 1.0 - share;
        [left, right].into_iter().for_each(|method| self.votes[method] += 1);
    }

    /// Adds the votes of another one as if they had been cast `times` times.
    fn add(&mut self, other: &Self, times: u16) {
        self.votes.iter_mut().zip(&other.votes).for_each(|(sum, votes)| *sum += usize::from(times) * votes);
        self.wins.iter_mut().zip(&other.wins).for_each(|(sum, wins)| *sum += f64::from(times) * wins);
    }

    /// The strengths that maximise the likelihood of the votes and of the given ties, with mean 0 over the methods that
    /// are `compared`; 0 for the others. By the cyclic MM algorithm of Hunter ("MM algorithms for generalized
    /// Bradley-Terry models", 2004, section 2).
    fn strengths(&self, compared: &[usize]) -> Vec<f64> {
        const MOST_ROUNDS: usize = 10_000;
        let methods = self.votes.len();
        let given = GIVEN_TIES / compared.len().saturating_sub(1).max(1) as f64;
        let mut odds = vec![1.0; methods];
        for _ in 0..MOST_ROUNDS {
            let mut change: f64 = 0.0;
            for &a in compared {
                let (mut won, mut expected) = (0.0, 0.0);
                for &b in compared.iter().filter(|b| **b != a) {
                    let (over, under) = (self.wins[a * methods + b], self.wins[b * methods + a]);
                    won += over + 0.5 * given;
                    expected += (over + under + given) / (odds[a] + odds[b]);
                }
                if expected > 0.0 {
                    change = change.max((won / expected / odds[a] - 1.0).abs());
                    odds[a] = won / expected;
                }
            }
            // The remaining error is this change times n / k, where k of n votes connect groups of methods.
            if change < 1e-10 {
                break;
            }
        }
        let logarithms: Vec<f64> = odds.into_iter().map(libm::log).collect();
        let mean = compared.iter().map(|at| logarithms[*at]).sum::<f64>() / compared.len().max(1) as f64;
        let mut strengths = vec![0.0; methods];
        for &at in compared {
            // Rounded, so that methods with the same votes are equal; the sum turns a negative zero into zero.
            strengths[at] = ((logarithms[at] - mean) * 1e6).round() / 1e6 + 0.0;
        }
        strengths
    }
}

/// The strengths by all voters and by each draw of them.
struct Counted {
    total: Tally,
    strengths: Vec<f64>,
    /// Empty with too few voters.
    drawn: Vec<Vec<f64>>,
}

impl Counted {
    fn new(voters: &[Tally], methods: usize) -> Self {
        let sum = |times: &dyn Fn(usize) -> u16| {
            let mut sum = Tally::new(methods);
            voters.iter().enumerate().for_each(|(at, tally)| sum.add(tally, times(at)));
            sum
        };
        let total = sum(&|_| 1);
        let compared: Vec<usize> = (0..methods).filter(|at| total.votes[*at] > 0).collect();
        let draws = (voters.len() >= LEAST_VOTERS).then(|| Draws::new(SEED, DRAWS, voters.len()));
        let drawn =
            draws.iter().flat_map(Draws::iter).map(|counts| sum(&|at| counts[at]).strengths(&compared)).collect();
        Self { strengths: total.strengths(&compared), drawn, total }
    }

    fn interval(&self, of: impl Fn(&[f64]) -> f64) -> Option<VoterInterval> {
        let values: Vec<f64> = self.drawn.iter().map(|strengths| of(strengths)).collect();
        let [low, high] = (!values.is_empty()).then(|| tails(values))?;
        Some(VoterInterval { low, high })
    }

    fn methods(&self, ranking: &Ranking) -> Vec<MethodStrength> {
        let of_wins = self.total.wins.chunks_exact(ranking.methods.len());
        let method = |(at, (method, wins)): (usize, (&RankedMethod, &[f64]))| {
            let is_voted = self.total.votes[at] > 0;
            MethodStrength {
                id: method.id.clone(),
                method: method.method.clone(),
                votes: self.total.votes[at],
                wins: wins.iter().sum(),
                strength: is_voted.then_some(self.strengths[at]),
                interval: self.interval(|strengths| strengths[at]).filter(|_| is_voted),
            }
        };
        let mut methods: Vec<MethodStrength> = ranking.methods.iter().zip(of_wins).enumerate().map(method).collect();
        let order = |method: &MethodStrength| -method.strength.unwrap_or(f64::NEG_INFINITY);
        methods.sort_by(|a, b| order(a).total_cmp(&order(b)));
        methods
    }

    fn numbers(&self, headline: &[ResultKey], ranking: &Ranking) -> Vec<Predictor> {
        let number = |key: &ResultKey| {
            let of_key = ranking.keys.get(key)?;
            let value = |(at, method): (usize, &RankedMethod)| {
                let standing = of_key.standings.iter().find(|standing| standing.method == method.id)?;
                (self.total.votes[at] > 0).then_some((at, of_key.better.sign() * standing.value))
            };
            let (places, values): (Vec<usize>, Vec<f64>) = ranking.methods.iter().enumerate().filter_map(value).unzip();
            let tau =
                |strengths: &[f64]| kendall_tau_b(&places.iter().map(|at| strengths[*at]).collect::<Vec<_>>(), &values);
            let tau_b = tau(&self.strengths);
            // A draw in which all methods are equal says nothing for the number and nothing against it.
            let interval = self.interval(|strengths| tau(strengths).unwrap_or(0.0)).filter(|_| tau_b.is_some());
            Some(Predictor { key: *key, methods: places.len(), tau_b, interval })
        };
        let mut numbers: Vec<Predictor> = headline.iter().filter_map(number).collect();
        let order = |number: &Predictor| -number.tau_b.unwrap_or(f64::NEG_INFINITY);
        numbers.sort_by(|a, b| order(a).total_cmp(&order(b)));
        numbers
    }
}

/// Both lists as tables, for a terminal of `columns`; of any width if absent.
pub fn plain(found: &Preferences, columns: Option<usize>) -> String {
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"));
    let interval = |ends: &Option<VoterInterval>| {
        ends.map_or_else(|| "-".to_owned(), |ends| format!("{:.2} to {:.2}", ends.low, ends.high))
    };
    let mut methods = vec![row(["Method", "Strength", "95 % interval", "Votes", "Won"])];
    methods.extend(found.methods.iter().map(|of| {
        let (votes, won) = (of.votes.to_string(), format!("{:.1}", of.wins));
        vec![shortened(&of.method), number(of.strength), interval(&of.interval), votes, won]
    }));
    let mut numbers = vec![row(["Number", "Tau-b", "95 % interval", "Methods"])];
    numbers.extend(
        found
            .numbers
            .iter()
            .map(|of| vec![of.key.to_string(), number(of.tau_b), interval(&of.interval), of.methods.to_string()]),
    );
    let title = format!(
        "Strengths of methods by {} votes of {} voters ({}, board {})",
        found.votes,
        found.voters,
        found.protocol,
        found.fingerprint.get(..16).unwrap_or(&found.fingerprint)
    );
    let title_of_numbers = "Correlation of headline numbers with strengths, the best predictor first".to_owned();
    let tables = [(title, methods), (title_of_numbers, numbers)];
    let tables = tables.map(|(title, rows)| Table { title, words: 1, rows }.text(columns)).join("\n");
    match found.voters < LEAST_VOTERS {
        true => format!("{tables}\nIntervals need at least {LEAST_VOTERS} voters.\n"),
        false => tables,
    }
}

#[cfg(test)]
mod tests {
    use mateval_dataset::splitmix64;

    use super::*;
    use crate::ranking::tests::{result, scores};

    /// PSNR falls from a to d; "e" is not voted on.
    fn board() -> Vec<ResultFile> {
        [("a", 30.0), ("b", 28.0), ("c", 26.0), ("d", 24.0), ("e", 22.0)]
            .map(|(name, psnr)| result(name, &scores(psnr, 0.1)))
            .into()
    }

    fn sitting(voter: &str, votes: Vec<(&str, &str, Closer)>) -> VotesFile {
        let method =
            |id: &str| VotedMethod { id: id.to_owned(), method: id.to_owned(), submission_sha256: String::new() };
        let vote = |(left, right, choice): (&str, &str, Closer)| Vote {
            scene: SceneId::new("s00").unwrap(),
            view: "input".to_owned(),
            picture: "albedo".to_owned(),
            left: left.to_owned(),
            right: right.to_owned(),
            choice,
            seconds: 1.5,
        };
        VotesFile {
            format: VOTES_FORMAT.to_owned(),
            tool: "mateval".to_owned(),
            protocol: "mateval-3".to_owned(),
            fingerprint: board()[0].protocols["mateval-3"].fingerprint.clone(),
            methods: ["a", "b", "c", "d", "e"].map(method).into(),
            voter: voter.to_owned(),
            sitting: format!("sitting of {voter}"),
            votes: votes.into_iter().map(vote).collect(),
        }
    }

    fn counted(files: &[VotesFile]) -> Result<Preferences, ReportError> {
        let folder = tempfile::tempdir().unwrap();
        let path = |at: usize| folder.path().join(format!("{at}.json"));
        files.iter().enumerate().for_each(|(at, file)| json::write(&path(at), file).unwrap());
        preferences(&(0..files.len()).map(path).collect::<Vec<_>>(), &board(), false, "mateval")
    }

    /// Voters who choose as these strengths say, each of whom sees every pair of the four methods `times` times.
    fn simulated(voters: u64, times: usize, strengths: [f64; 4]) -> Vec<VotesFile> {
        let names = ["a", "b", "c", "d"];
        let sitting_of = |voter: u64| {
            let mut index = 0;
            let mut uniform = || {
                index += 1;
                (splitmix64::number(voter, index) >> 11) as f64 / (1_u64 << 53) as f64
            };
            let mut votes = Vec::new();
            for (left, right) in (0..4).flat_map(|a| (0..4).map(move |b| (a, b))).filter(|(a, b)| a != b) {
                for _ in 0..times {
                    let closer = 1.0 / (1.0 + (strengths[right] - strengths[left]).exp());
                    let choice = if uniform() < closer { Closer::Left } else { Closer::Right };
                    votes.push((names[left], names[right], choice));
                }
            }
            sitting(&format!("voter {voter}"), votes)
        };
        (0..voters).map(sitting_of).collect()
    }

    fn of<'a>(found: &'a Preferences, id: &str) -> &'a MethodStrength {
        found.methods.iter().find(|method| method.id == id).unwrap()
    }

    #[test]
    fn simulated_voters_recover_a_planted_order() {
        let planted = [-0.9, 1.0, 0.3, -0.4];
        let found = counted(&simulated(20, 8, planted)).unwrap();
        assert_eq!((found.voters, found.votes), (20, 20 * 12 * 8));
        assert_eq!(found.methods.iter().map(|method| method.id.as_str()).collect::<String>(), "bcdae");
        for (id, planted) in ["a", "b", "c", "d"].iter().zip(planted) {
            let method = of(&found, id);
            let (strength, ends) = (method.strength.unwrap(), method.interval.unwrap());
            assert!((strength - planted).abs() < 0.15, "{id} {strength} {planted}");
            assert!(ends.low < planted && planted < ends.high && ends.high - ends.low < 0.5, "{id} {ends:?}");
        }
        // PSNR has the order a, b, c, d: it agrees on b-c, b-d and c-d, and misplaces a against each of them.
        let number = &found.numbers[0];
        assert_eq!(
            (number.key.to_string(), number.methods, number.tau_b),
            ("albedo.input.psnr".to_owned(), 4, Some(0.0))
        );
        let text = plain(&found, None);
        assert!(text.contains("1920 votes of 20 voters") && !text.contains("at least"), "{text}");
    }

    /// The same votes in another order of files, and one person's votes in two sittings, are the same votes.
    #[test]
    fn voters_are_drawn_and_not_files() {
        let files = simulated(6, 1, [0.5, 0.2, -0.1, -0.6]);
        let found = counted(&files).unwrap();
        assert_eq!(counted(&files.iter().rev().cloned().collect::<Vec<_>>()).unwrap(), found);
        let mut split = files;
        let mut second = split[0].clone();
        second.sitting.push('2');
        second.votes = split[0].votes.split_off(5);
        split.push(second);
        assert_eq!(counted(&split).unwrap(), found);
    }

    #[test]
    fn ties_are_half_a_vote_for_either() {
        use Closer::{Equal, Left, Right};
        let even = counted(&[sitting("x", vec![("a", "b", Equal), ("b", "a", Equal)])]).unwrap();
        assert_eq!([of(&even, "a").strength, of(&even, "b").strength], [Some(0.0); 2]);
        assert_eq!((of(&even, "a").wins, of(&even, "a").votes), (1.0, 2));
        let split = counted(&[sitting("x", vec![("a", "b", Left), ("a", "b", Right)])]).unwrap();
        assert_eq!(even.methods, split.methods);
        // All methods equal: no order, so no correlation.
        assert!(even.numbers[0].tau_b.is_none());
    }

    #[test]
    fn one_voter_has_strengths_without_intervals() {
        let found = counted(&[sitting("x", vec![("a", "b", Closer::Left), ("d", "c", Closer::Right)])]).unwrap();
        // By symmetry a and c have strength s, b and d -s. Each pair has a third of a given tie, so the likelihood of a
        // has its maximum where 1 + 3 / 6 = 5 / 3 p + 1 / 6 with p = 1 / (1 + exp(-2 s)): p = 0.8, s = ln 2.
        let ln_2 = (std::f64::consts::LN_2 * 1e6).round() / 1e6;
        for (id, sign) in [("a", 1.0), ("b", -1.0), ("c", 1.0), ("d", -1.0)] {
            assert_eq!(of(&found, id).strength, Some(sign * ln_2), "{id}");
        }
        assert!(found.methods.iter().all(|method| method.interval.is_none()) && found.numbers[0].interval.is_none());
        assert!(plain(&found, Some(60)).contains("Intervals need at least 5 voters."));
    }

    #[test]
    fn methods_without_votes_have_no_strength() {
        let found = counted(&simulated(6, 1, [0.5, 0.2, -0.1, -0.6])).unwrap();
        let last = found.methods.last().unwrap();
        assert_eq!((last.id.as_str(), last.votes, last.strength, last.interval), ("e", 0, None, None));
        assert_eq!(found.numbers[0].methods, 4);
        let found = counted(&[sitting("x", Vec::new())]).unwrap();
        assert!(found.numbers.iter().all(|number| number.tau_b.is_none() && number.methods == 0));
    }

    #[test]
    fn votes_that_cannot_be_counted_are_named() {
        let vote = || vec![("a", "b", Closer::Left)];
        let mut files = ["w", "x", "y", "z"].map(|voter| sitting(voter, vote()));
        files[0].fingerprint = "0123".to_owned();
        files[1].methods[1].submission_sha256 = "changed".to_owned();
        files[2].votes[0].right = "f".to_owned();
        files[3].sitting = files[2].sitting.clone();
        let error = counted(&files).unwrap_err().to_string();
        for expected in
            ["votes on the board '0123'", "no result is of the method 'b'", "/votes/0", "votes of the same sitting"]
        {
            assert!(error.contains(expected), "{expected}: {error}");
        }
        assert_eq!(error.matches(".json").count(), 5, "{error}");
    }
}
