#![no_main]
//! Reads `submission.json` as scoring and as `eval lint` do: both must accept the same files.

use libfuzzer_sys::fuzz_target;
use mateval_dataset::Severity;
use mateval_dataset::submission::SUBMISSION;
use mateval_submission::lint::submission_json;
use mateval_submission::files::SubmissionJson;

fuzz_target!(|bytes: &[u8]| {
    mateval_fuzz::with_file(SUBMISSION, bytes, |path| {
        let folder = path.parent().expect("the file lies in a folder");
        let (_, findings) = submission_json::check(folder, &"0".repeat(64));
        let is_sound = findings.iter().all(|finding| finding.severity != Severity::Error);
        assert_eq!(SubmissionJson::read(folder).is_ok(), is_sound, "{findings:?}");
    });
});
