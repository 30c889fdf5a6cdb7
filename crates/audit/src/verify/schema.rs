//! Checks JSON files against the schemas generated from the Rust types.

use std::path::Path;

use schemars::JsonSchema;

use mateval_prep::faults::Faults;

/// Checks `folder/file` against the schema of `T`. Every violation is a fault with its JSON pointer.
pub(super) fn check<T: JsonSchema>(folder: &Path, file: &str, faults: &mut Faults) {
    let Some(text) = faults.read(file, std::fs::read(folder.join(file))) else { return };
    let Some(value) = faults.read(file, serde_json::from_slice::<serde_json::Value>(&text)) else { return };
    let schema = serde_json::to_value(schemars::schema_for!(T)).expect("a schema can be written as JSON");
    let validator = jsonschema::validator_for(&schema).expect("schemars generates valid schemas");
    for error in validator.iter_errors(&value) {
        let message = error.to_string();
        // The message quotes the value, which may be long.
        let short: String = message.chars().take(300).collect();
        faults.add("breaks_schema", file, error.instance_path().to_string(), short);
    }
}
