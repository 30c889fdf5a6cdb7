//! `mateval fetch` without a network, and without a Python.

use super::command::{mateval, run};

#[test]
fn what_exists_is_named_and_not_downloaded_again() {
    if mateval_testkit::lpips_weights("lpips-alex-v0.1.safetensors").is_none() {
        return;
    }
    let mut command = mateval();
    command.args(["fetch", "lpips"]).env("PIP_INDEX_URL", "http://127.0.0.1:9/");
    let found = run(&mut command).ends_with(0).says("already present: ");
    assert_eq!(found.stdout.lines().count(), 2, "{}", found.stdout);
    assert!(found.stdout.contains("lpips-alex-v0.1.safetensors"), "{}", found.stdout);
}

#[test]
fn without_a_network_it_says_what_to_do() {
    let empty = tempfile::tempdir().unwrap();
    let mut command = mateval();
    command.args(["fetch", "lpips"]).env("MATEVAL_CACHE", empty.path());
    command.env("PIP_INDEX_URL", "http://127.0.0.1:9/").env("PIP_RETRIES", "0").env_remove("PIP_EXTRA_INDEX_URL");
    let failed = run(&mut command)
        .ends_with(2)
        .says("pip could not fetch")
        .says("is the network reachable?")
        .says("--lpips-archive");
    assert_eq!(failed.stdout, "");
    assert_eq!(std::fs::read_dir(empty.path()).unwrap().count(), 0);
}

#[test]
fn a_python_that_does_not_exist_is_named() {
    let empty = tempfile::tempdir().unwrap();
    let python = empty.path().join("python3");
    let mut command = mateval();
    command.args(["fetch", "blender"]).env("MATEVAL_PYTHON", &python);
    run(&mut command).ends_with(2).says(&format!("'{}'", python.display())).says("MATEVAL_PYTHON");
}
