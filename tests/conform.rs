//! The matrix on this driver, and that each of its rows can fail.
mod support;

use support::{stderr, stdout, welkin};

#[test]
fn the_driver_does_what_welkin_needs() {
    let output = welkin().args(["conform", "--quick", "--json"]).output().unwrap();
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    let device = &report["devices"][0];
    assert!(device["passed"].as_u64().unwrap() > 0);
    assert!(device["device"]["validation"].as_bool().unwrap());
    for row in device["rows"].as_array().unwrap() {
        assert_eq!(row["result"] == "skip", row["reason"].is_string(), "{row}");
        assert_eq!(row["validation_messages"].as_array().unwrap().len(), 0, "{row}");
    }
}
