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
    let open = |sabotage| Lab::open(LabOptions { device: None, effort: Effort::Quick, sabotage }).unwrap();
    let checks = conform::checks();
    let mut whole = open(None);
    let mut tried = 0;
    for sabotage in [Sabotage::Expected, Sabotage::Unordered, Sabotage::Reversed, Sabotage::Commutative, Sabotage::Lost]
    {
        let mut lab = open(Some(sabotage));
        for check in checks.iter().filter(|check| check.fails_by.contains(&sabotage)) {
            let outcome = check.run(&mut lab);
            assert!(
                !outcome.device_failed && outcome.validation.is_empty(),
                "{} by {sabotage:?}: {outcome:?}",
                check.id
            );
            match outcome.verdict {
                Verdict::Fail { .. } => tried += 1,
                Verdict::Pass(note) => panic!("{} does not see {sabotage:?}: {note}", check.id),
                Verdict::Skip(reason) => {
                    let plain = check.run(&mut whole).verdict;
                    assert_eq!(plain, Verdict::Skip(reason), "{} by {sabotage:?}", check.id);
                }
            }
        }
    }
    assert!(tried > 50, "{tried}");
}
