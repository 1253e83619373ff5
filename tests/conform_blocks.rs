//! The building blocks of every mode on this driver, and that each of their rows can fail: shaders, flags and expectations
//! are broken on purpose, one at a time.

use welkin::conform::Sabotage::{Expected, Lost, Reversed, Unordered};
use welkin::conform::{Check, Effort, Group, Lab, LabOptions, Sabotage, Verdict, checks, matches};

fn lab(sabotage: Option<Sabotage>) -> Lab {
    let lab = Lab::open(LabOptions { effort: Effort::Quick, sabotage, ..LabOptions::default() }).unwrap();
    assert!(lab.validated(), "the layer is installed by set-up");
    lab
}

fn rows() -> Vec<Check> {
    checks().into_iter().filter(|check| check.group == Group::Blocks).collect()
}

/// Which breakages a row must see; the first pattern that fits counts.
const SEES: &[(&str, &[Sabotage])] = &[
    ("blocks.*.full", &[Lost, Unordered, Reversed, Expected]), // reversed: written where there is no room
    ("blocks.append", &[Lost, Unordered, Expected]),
    ("blocks.linked-lists", &[Lost, Unordered, Expected]),
    ("blocks.indirect.dispatch", &[Lost, Reversed, Expected]),
    ("blocks.indirect.draw", &[Lost, Expected]),
    ("blocks.prefix-sum", &[Lost]),
    ("blocks.stable-sort", &[Lost, Reversed]), // reversed: equal keys change places
    ("blocks.compaction", &[Lost, Reversed]),
    ("blocks.filter.*", &[Lost, Reversed, Unordered, Expected]), // unordered: another way to repeat
    ("blocks.half.*", &[Lost, Reversed, Expected]),
    ("blocks.timestamps.order", &[Reversed, Expected]),
    ("blocks.timestamps.*", &[Lost, Reversed]),
];

fn seen_by(id: &str) -> &'static [Sabotage] {
    SEES.iter().find(|(pattern, _)| matches(pattern, id)).unwrap_or_else(|| panic!("{id} is proved by nothing")).1
}

#[test]
fn every_building_block_works() {
    let mut lab = lab(None);
    let mut passed = 0;
    for check in rows() {
        let outcome = check.run(&mut lab);
        println!("{:32} {:5.2} s  {:?}", check.id, outcome.seconds, outcome.verdict);
        match outcome.verdict {
            Verdict::Pass(_) => passed += 1,
            Verdict::Skip(reason) => assert!(check.id.starts_with("blocks.timestamps."), "{}: {reason}", check.id),
            Verdict::Fail { expected, found } => panic!("{}: expected {expected}, found {found}", check.id),
        }
        assert_eq!(outcome.validation, Vec::<String>::new(), "{}", check.id);
    }
    assert!(passed >= 20, "{passed}");
}

#[test]
fn every_building_block_can_fail() {
    for sabotage in [Expected, Lost, Unordered, Reversed] {
        let mut lab = lab(Some(sabotage));
        for check in rows().iter().filter(|check| seen_by(&check.id).contains(&sabotage)) {
            let outcome = check.run(&mut lab);
            println!("{:32} {:?}: {:?}", check.id, sabotage, outcome.verdict);
            assert!(matches!(outcome.verdict, Verdict::Fail { .. }), "{} does not see {sabotage:?}", check.id);
            assert_eq!(outcome.validation, Vec::<String>::new(), "{} fails for another reason", check.id);
            assert!(!outcome.device_failed, "{}", check.id);
        }
    }
}
