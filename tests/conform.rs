//! The matrix on this driver, and that each of its rows can fail.
mod support;

use support::{stderr, stdout, welkin};
use welkin::conform::{self, Effort, Lab, LabOptions, Sabotage, Verdict};

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

/// Breaks each check on purpose, in every way that its row names; it must fail each time.
#[test]
fn every_check_can_fail() {
    let checks = conform::checks();
    for sabotage in [Sabotage::Expected, Sabotage::Unordered, Sabotage::Reversed, Sabotage::Commutative, Sabotage::Lost]
    {
        let options = LabOptions { device: None, effort: Effort::Quick, sabotage: Some(sabotage) };
        let mut lab = Lab::open(options).unwrap();
        for check in checks.iter().filter(|check| check.fails_by.contains(&sabotage)) {
            let outcome = check.run(&mut lab);
            let failed = matches!(outcome.verdict, Verdict::Fail { .. } | Verdict::Skip(_));
            assert!(failed && outcome.validation.is_empty(), "{} by {sabotage:?}: {outcome:?}", check.id);
        }
    }
}
