//! The dependencies between the crates, which are those that `crates/README.md` draws, and the licences of all packages,
//! from `cargo metadata`.

use std::collections::{BTreeMap, BTreeSet};

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, Package};

/// Crates that only tests and benchmarks may use.
const FOR_TESTS: &str = "mateval-testkit";

/// Licences of code that may be linked into a program that is itself MIT or Apache-2.0.
const LICENCES: [&str; 13] = [
    "MIT",
    "MIT-0",
    "Apache-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "0BSD",
    "Zlib",
    "MPL-2.0",
    "Unicode-3.0",
    "Unicode-DFS-2016",
    "ISC",
    "CC0-1.0",
    "Unlicense",
];

/// The packages for this machine's platform; those for other platforms are not downloaded.
fn metadata() -> Metadata {
    let version = std::process::Command::new("rustc").arg("-vV").output().unwrap();
    let text = String::from_utf8(version.stdout).unwrap();
    let host = text.lines().find_map(|line| line.strip_prefix("host: ")).unwrap().to_owned();
    let options = ["--locked".to_owned(), "--filter-platform".to_owned(), host];
    MetadataCommand::new()
        .manifest_path(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"))
        .other_options(options)
        .exec()
        .unwrap()
}

/// The crates of ours that each crate uses, as a map draws them: lines as `prep -> sources, dataset`. `cli`, the
/// package that is called like the project, may use all others but `python`, which uses it.
fn drawn(map: &str) -> BTreeMap<&str, BTreeSet<&str>> {
    let is_word = |user: &str| !user.is_empty() && user.chars().all(|c| c.is_ascii_lowercase());
    let lines = map.lines().filter_map(|line| line.split_once(" -> "));
    let lines = lines.map(|(user, used)| (user.trim(), used)).filter(|(user, _)| is_word(user));
    let mut arrows: BTreeMap<&str, BTreeSet<&str>> = lines
        .map(|(user, used)| (user, used.split(", ").map(str::trim).filter(|name| is_word(name)).collect()))
        .collect();
    let below: BTreeSet<&str> = arrows.keys().copied().filter(|name| !["cli", "python"].contains(name)).collect();
    if let Some(used) = arrows.get_mut("cli") {
        *used = below;
    }
    arrows
}

/// A crate's name on the map.
fn short(package: &str) -> &str {
    if package == "mateval" { "cli" } else { package.trim_start_matches("mateval-") }
}

/// The arrows of a package that the map does not draw, and those that it draws in vain.
fn differences(package: &str, used: &[&str], drawn: &BTreeMap<&str, BTreeSet<&str>>) -> Vec<String> {
    let Some(expected) = drawn.get(short(package)) else { return vec![format!("the map has no '{package}'")] };
    let used: BTreeSet<&str> = used.iter().map(|name| short(name)).collect();
    let in_vain = expected.difference(&used).filter(|_| package != "mateval");
    used.difference(expected).chain(in_vain).map(|name| format!("{} -> {name}", short(package))).collect()
}

/// The crates of ours that the package uses when it is built (not when it is tested).
fn uses(package: &Package) -> Vec<&str> {
    let used = package.dependencies.iter().filter(|dependency| dependency.kind != DependencyKind::Development);
    used.map(|dependency| dependency.name.as_str()).filter(|name| name.starts_with("mateval")).collect()
}

#[test]
fn the_arrows_are_those_of_the_map() {
    let map = include_str!("../../crates/README.md");
    let drawn = drawn(map);
    let metadata = metadata();
    let mut members = metadata.workspace_packages();
    members.retain(|package| package.name.as_str() != FOR_TESTS);
    let names: BTreeSet<&str> = members.iter().map(|package| short(&package.name)).collect();
    assert_eq!(names, drawn.keys().copied().collect());
    let wrong: Vec<String> =
        members.iter().flat_map(|package| differences(&package.name, &uses(package), &drawn)).collect();
    assert_eq!(wrong, [""; 0]);
    let all: usize = members.iter().map(|package| uses(package).len()).sum();
    assert!(all > 40, "only {all} arrows seen");
}

/// The twin: dependencies in the opposite direction, and arrows that nothing follows.
#[test]
fn a_wrong_arrow_is_found() {
    let drawn = drawn("a    -> (none)\nb    -> a\nc -> a, b\ncli  -> all of them\nno arrow -> at all\n");
    assert_eq!(differences("mateval-a", &["mateval-b"], &drawn), ["a -> b"]);
    assert_eq!(differences("mateval-c", &["mateval-a"], &drawn), ["c -> b"]);
    assert_eq!(differences("mateval-c", &["mateval-a", "mateval-b"], &drawn), [""; 0]);
    assert_eq!(differences("mateval", &["mateval-a", "mateval-b"], &drawn), [""; 0]);
    assert_eq!(differences("mateval-utils", &[], &drawn).len(), 1);
}

/// Only one module may name obvhs, so only one crate may use it.
#[test]
fn only_the_tracer_uses_obvhs() {
    let metadata = metadata();
    let uses_obvhs = |package: &&&Package| package.dependencies.iter().any(|dependency| dependency.name == "obvhs");
    let members = metadata.workspace_packages();
    let users: Vec<&str> = members.iter().filter(uses_obvhs).map(|package| package.name.as_str()).collect();
    assert_eq!(users, ["mateval-tracer"]);
}

#[test]
fn every_package_has_a_licence_that_we_may_use() {
    let metadata = metadata();
    let offered = |package: &&Package| package.license.as_deref().is_some_and(offers);
    let wrong = metadata.packages.iter().filter(|package| !offered(package));
    let wrong: Vec<String> = wrong.map(|package| format!("{} {:?}", package.name, package.license)).collect();
    assert_eq!(wrong, [""; 0]);
    assert!(metadata.packages.len() > 150, "only {} packages seen", metadata.packages.len());
}

#[test]
fn licence_expressions_are_understood() {
    let good = [
        "MIT",
        "MIT/Apache-2.0",
        "MIT OR GPL-3.0",
        "(MIT OR GPL-3.0) AND Unicode-3.0",
        "Apache-2.0 WITH LLVM-exception OR GPL-2.0",
    ];
    for text in good {
        assert!(offers(text), "{text}");
    }
    let bad = ["GPL-3.0", "MIT AND GPL-3.0", "LGPL-2.1-or-later", "", "MIT AND (GPL-3.0 OR SSPL-1.0)", "(MIT", "MIT)"];
    for text in bad {
        assert!(!offers(text), "{text}");
    }
}

/// Whether an SPDX expression can be satisfied with [`LICENCES`] alone. A text that is no such expression cannot.
fn offers(expression: &str) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    matches!(any_of(&words), Some((true, [])))
}

/// `a OR b ...`: whether it can be satisfied, and the words after it.
fn any_of<'a>(words: &'a [&'a str]) -> Option<(bool, &'a [&'a str])> {
    let (mut met, mut rest) = all_of(words)?;
    while let ["OR", after @ ..] = rest {
        let (other, after) = all_of(after)?;
        (met, rest) = (met || other, after);
    }
    Some((met, rest))
}

/// `a AND b ...`.
fn all_of<'a>(words: &'a [&'a str]) -> Option<(bool, &'a [&'a str])> {
    let (mut met, mut rest) = one(words)?;
    while let ["AND", after @ ..] = rest {
        let (other, after) = one(after)?;
        (met, rest) = (met && other, after);
    }
    Some((met, rest))
}

/// A licence (an exception only grants more), or an expression in brackets.
fn one<'a>(words: &'a [&'a str]) -> Option<(bool, &'a [&'a str])> {
    match words {
        ["(", rest @ ..] => match any_of(rest)? {
            (met, [")", rest @ ..]) => Some((met, rest)),
            _ => None,
        },
        [licence, "WITH", _, rest @ ..] | [licence, rest @ ..] => Some((LICENCES.contains(licence), rest)),
        [] => None,
    }
}
