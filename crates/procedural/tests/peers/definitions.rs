//! The variants of nodes, with the defaults of their inputs, against the definitions of MaterialX' standard library.

use mateval_procedural::node::{Kind, Signature, Unset, signatures};
use serde_json::{Value, json};

use super::python::with_materialx;

fn described(kind: Kind, signature: &Signature) -> Value {
    let default = |unset: &Unset| match unset {
        Unset::Value(value) => json!(value.numbers()),
        Unset::Place => json!("place"),
    };
    let inputs = signature.inputs.iter().map(|input| json!([input.name, input.kind.word(), default(&input.unset)]));
    let outputs = signature.outputs.iter().map(|(name, kind)| json!([name, kind.word()]));
    json!({ "node": kind.word(), "inputs": inputs.collect::<Vec<_>>(), "outputs": outputs.collect::<Vec<_>>() })
}

/// The variants that MaterialX does not have.
fn unknown(variants: &[Value]) -> Vec<Value> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("variants.json");
    std::fs::write(&file, json!(variants).to_string()).unwrap();
    serde_json::from_slice(&with_materialx("check_definitions.py", &[file.as_os_str()])).unwrap()
}

#[test]
fn variants_and_defaults_are_those_of_the_standard_library() {
    let of = |&kind: &Kind| signatures(kind).into_iter().map(move |signature| described(kind, &signature));
    let all: Vec<Value> = Kind::ALL.iter().flat_map(of).collect();
    assert_eq!(unknown(&all), [Value::Null; 0]);
    assert!(all.len() > 200, "{}", all.len());
    // The twin: another default.
    let mut changed = all[0].clone();
    changed["inputs"][0][2] = json!([0.5]);
    assert_eq!(unknown(std::slice::from_ref(&changed)), [changed]);
}
