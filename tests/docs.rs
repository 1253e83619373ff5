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
