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

/// What `welkin conform` with `words` prints, and its exit status.
fn run(words: &[&str]) -> (String, String, i32) {
    let output = welkin().arg("conform").args(words).output().unwrap();
    (stdout(&output), stderr(&output), output.status.code().unwrap())
}

#[test]
fn the_matrix_can_be_listed_and_filtered() {
    let (text, _, status) = run(&["--list", "--json", "--filter", "attachment.*.merge", "--filter", "static.*"]);
    let rows: Vec<serde_json::Value> = serde_json::from_str(&text).unwrap();
    assert_eq!(status, 0);
    for row in &rows {
        let id = row["id"].as_str().unwrap();
        assert!(id.starts_with("static.") || id.ends_with(".merge"), "{id}");
        assert!(
            ["what", "why", "spec"].iter().all(|key| row[key].as_str().is_some_and(|text| text.len() > 5)),
            "{row}"
        );
    }
    assert!(rows.len() >= 4, "{rows:?}");
    let (_, message, status) = run(&["--filter", "nothing*"]);
    assert!(status == 2 && message.contains("--filter = nothing*: expected a pattern"), "{message}");
    let (_, message, status) = run(&["--device", "voodoo", "--filter", "static.*"]);
    assert!(status == 2 && message.contains("--device = voodoo: expected part of the name"), "{message}");
}

#[test]
fn a_check_that_takes_too_long_fails_with_status_1() {
    // A thousand frames: seconds on a CPU, less than the limit on fast hardware.
    let words = ["--json", "--timeout", "1", "--filter", "attachment.subpass.determinism", "--filter", "static.*"];
    let (text, _, status) = run(&words);
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    let device = &report["devices"][0];
    assert_eq!(status, i32::from(device["failed"].as_u64().unwrap() > 0), "{text}");
    if device["device"]["kind"] == "cpu" {
        let rows = device["rows"].as_array().unwrap();
        let slow = rows.iter().find(|row| row["id"] == "attachment.subpass.determinism").unwrap();
        assert_eq!((&slow["result"], &slow["found"]), (&"fail".into(), &"nothing for 1 s".into()));
        assert!(rows.iter().any(|row| row["result"] == "pass"), "{text}");
    }
}

/// What `--unordered` must show it can only show on hardware; a row that does not must fail.
#[test]
fn without_ordering_a_right_picture_fails() {
    let (text, message, status) = run(&["--json", "--quick", "--unordered", "--filter", "attachment.subpass.merge"]);
    let report: serde_json::Value = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{text}{message}"));
    let row = &report["devices"][0]["rows"][0];
    if report["devices"][0]["device"]["kind"] == "cpu" {
        // A software rasterizer keeps a pixel's fragments in order even where nobody asks for it.
        assert_eq!((status, &row["result"], &row["found"]), (1, &"fail".into(), &"the right one".into()), "{row}");
    }
    let (text, _, _) = run(&["--list", "--json", "--unordered"]);
    let rows: Vec<serde_json::Value> = serde_json::from_str(&text).unwrap();
    let of_order = |row: &serde_json::Value| row["group"] == "interlock" || row["group"] == "attachment";
    assert!(rows.len() > 50 && rows.iter().all(of_order), "{}", rows.len());
}
