//! Where two JSON values differ.

use serde_json::Value;

use crate::metric::Metric;
use crate::result_key::ResultKey;

/// Two values at one place that are not the same.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Difference {
    pub(crate) place: String,
    pub(crate) said: String,
    pub(crate) found: String,
}

/// All differences, in the order of places. Numbers must be the same to the last bit, or within their metric's
/// [`Metric::tolerance`].
pub(crate) fn differences(said: &Value, found: &Value) -> Vec<Difference> {
    let mut differences = Vec::new();
    compare(said, found, &Place { pointer: String::new(), tolerance: 0.0 }, &mut differences);
    differences
}

struct Place {
    pointer: String,
    tolerance: f64,
}

impl Place {
    fn below(&self, key: &str, tolerance: f64) -> Self {
        let escaped = key.replace('~', "~0").replace('/', "~1");
        Self { pointer: format!("{}/{escaped}", self.pointer), tolerance }
    }
}

fn compare(said: &Value, found: &Value, place: &Place, differences: &mut Vec<Difference>) {
    match (said, found) {
        (Value::Object(a), Value::Object(b)) => {
            let mut keys: Vec<&String> = a.keys().chain(b.keys()).collect();
            keys.sort();
            keys.dedup();
            for key in keys {
                // A mean by its key, or a picture's value by its metric.
                let metric = key.parse::<ResultKey>().map(|key| key.metric).or_else(|_| key.parse()).ok();
                let pair = [a, b].map(|map| map.get(key).unwrap_or(&Value::Null));
                compare(pair[0], pair[1], &place.below(key, metric.map_or(0.0, Metric::tolerance)), differences);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (at, (a, b)) in a.iter().zip(b).enumerate() {
                compare(a, b, &place.below(&at.to_string(), 0.0), differences);
            }
        }
        _ if same(said, found, place.tolerance) => {}
        _ => differences.push(Difference { place: place.pointer.clone(), said: short(said), found: short(found) }),
    }
}

fn same(said: &Value, found: &Value, tolerance: f64) -> bool {
    match (said.as_f64(), found.as_f64()) {
        (Some(a), Some(b)) if tolerance > 0.0 => (a - b).abs() <= tolerance,
        _ => said == found,
    }
}

/// A value that fits in a line.
fn short(value: &Value) -> String {
    match value {
        Value::Array(list) => format!("a list of {}", list.len()),
        Value::Object(map) => format!("an object of {} members", map.len()),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn places(said: &Value, found: &Value) -> Vec<String> {
        differences(said, found).into_iter().map(|difference| difference.place).collect()
    }

    #[test]
    fn numbers_agree_to_the_last_bit() {
        let value = 0.1_f64;
        let next = f64::from_bits(value.to_bits() + 1);
        let said = json!({"summary": {"rgb_true.input.mse": value}, "list": [1, {"a/b": value}]});
        assert!(places(&said, &said).is_empty());
        let mut found = said.clone();
        found["summary"]["rgb_true.input.mse"] = next.into();
        found["list"][1]["a/b"] = next.into();
        assert_eq!(places(&said, &found), ["/list/1/a~1b", "/summary/rgb_true.input.mse"]);
    }

    #[test]
    fn lpips_agrees_to_five_decimals() {
        let value = |by: f64| {
            json!({
                "summary": {"albedo.input.lpips_alex": 0.25 + by},
                "pictures": [{"values": {"lpips_alex": 0.25 + by}}],
            })
        };
        assert!(places(&value(0.0), &value(9e-6)).is_empty());
        let both = ["/pictures/0/values/lpips_alex", "/summary/albedo.input.lpips_alex"];
        assert_eq!(places(&value(0.0), &value(1.1e-5)), both);
        // The twin: other metrics have no tolerance.
        let mse = |by: f64| json!({"pictures": [{"values": {"mse": 0.25 + by}}]});
        assert_eq!(places(&mse(0.0), &mse(1e-9)), ["/pictures/0/values/mse"]);
    }

    #[test]
    fn missing_values_and_other_types_differ() {
        let said = json!({"a": [1, 2], "b": "x", "c": 1});
        let found = json!({"a": [1], "b": 2, "d": 1});
        let found: Vec<[String; 3]> =
            differences(&said, &found).into_iter().map(|d| [d.place, d.said, d.found]).collect();
        let expected =
            [["/a", "a list of 2", "a list of 1"], ["/b", "\"x\"", "2"], ["/c", "1", "null"], ["/d", "null", "1"]];
        assert_eq!(found, expected.map(|row| row.map(str::to_owned)));
    }
}
