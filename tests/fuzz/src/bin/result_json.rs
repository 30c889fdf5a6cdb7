#![no_main]
//! Reads `RESULT.json` and makes tables of it.

use libfuzzer_sys::fuzz_target;
use mateval_eval::result::ResultFile;
use mateval_report::tables::{Grouping, TableFormat, tables};
use mateval_dataset::json;

fuzz_target!(|bytes: &[u8]| {
    mateval_fuzz::with_file("RESULT.json", bytes, |path| {
        let Ok(result) = json::read::<ResultFile>(path) else { return };
        for grouping in [Grouping::Dataset, Grouping::Scene, Grouping::Category] {
            let _ = tables(std::slice::from_ref(&result), None, "mateval-3", grouping, TableFormat::Latex);
        }
    });
});
