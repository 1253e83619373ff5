//! The documentation names tests; they exist.

use std::fs;
use std::path::Path;

#[test]
fn every_test_that_the_crate_documentation_names_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("src/lib.rs")).unwrap();
    let named: Vec<_> = text.split('`').filter_map(|code| code.split_once(".rs::")).collect();
    assert!(named.len() > 20, "the list of departures is gone: {} tests are named", named.len());
    for (file, name) in named {
        let path = root.join(format!("{file}.rs"));
        let source = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let test = source.contains(&format!("fn {name}(")) && source.contains("#[test]");
        assert!(test, "{file}.rs has no test {name}");
    }
}

#[test]
fn the_scene_documentation_tells_every_choice_of_the_axes() {
    use welkin::params::{BLENDS, LIGHTINGS, SOURCES, lightings_of};
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/scene.md")).unwrap();
    let mut lines: Vec<String> = vec!["| source | lighting |".into(), "|---|---|".into()];
    lines.extend(SOURCES.iter().filter(|row| row.here).map(|row| {
        let names: Vec<_> = lightings_of(row.value).iter().map(|method| format!("`{}`", method.axis.name)).collect();
        format!("| `{}`: {} | {} |", row.name, row.about, names.join(", "))
    }));
    let about = |name: &str, about: &str| format!("| `{name}` | {about} |");
    lines.push(String::new());
    lines.extend(["| lighting | what it does |".into(), "|---|---|".into()]);
    lines.extend(LIGHTINGS.iter().filter(|m| m.axis.here).map(|m| about(m.axis.name, m.axis.about)));
    lines.push(String::new());
    lines.extend(["| compositing | what it does |".into(), "|---|---|".into()]);
    lines.extend(BLENDS.iter().filter(|row| row.here).map(|row| about(row.name, row.about)));
    let expected = lines.join("\n");
    assert!(text.contains(&expected), "docs/scene.md should say:\n{expected}");
}
