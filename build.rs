//! Compiles every entry file under `glsl/`, reflects the SPIR-V, and writes three tables for the crate:
//! `shaders.rs` (one typed module per program), `layout.rs` (offset of every member of every shared struct) and
//! `constants.rs` (the numbers that shaders have names for).
//!
//! Entry files end in `.comp`, `.vert` or `.frag`; `.glsl` files are includes. A fragment shader names its vertex
//! shader in a line `// vertex: <path>`, and the two become one program. An entry file with a line `// lighting: each` is
//! compiled once for each folder `lighting/<method>` that has a `source.glsl`, which takes the place of the include
//! `lighting/source.glsl`.

#![allow(clippy::expect_used)] // A build script has nobody to return an error to.

#[path = "build/compile.rs"]
mod compile;
#[path = "build/constants.rs"]
mod constants;
#[path = "build/emit.rs"]
mod emit;
#[path = "build/reflect.rs"]
mod reflect;

use std::path::{Path, PathBuf};
use std::{env, fs, process};

fn main() {
    println!("cargo::rerun-if-changed=glsl");
    println!("cargo::rerun-if-changed=build");
    println!("cargo::rerun-if-changed=build.rs");
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR")).join("glsl");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));

    let mut entries = Vec::new();
    collect(&root, &root, &mut entries);
    entries.sort();
    let texts: Vec<_> = entries
        .iter()
        .map(|name| (name.clone(), fs::read_to_string(root.join(name)).expect("glsl/ is readable")))
        .collect();
    fs::write(out.join("constants.rs"), constants::constants(&texts)).expect("OUT_DIR is writable");
    entries.retain(|name| !name.ends_with(".glsl"));
    let lightings = lightings(&root);

    let mut modules = Vec::new();
    let mut failed = false;
    let variants = entries.iter().flat_map(|name| {
        let source = fs::read_to_string(root.join(name)).unwrap_or_default();
        let each = source.lines().any(|line| line == "// lighting: each");
        let lightings = if each { lightings.iter().cloned().map(Some).collect() } else { vec![None] };
        lightings.into_iter().map(move |lighting| (name, lighting))
    });
    for (name, lighting) in variants {
        match compile::compile(&root, name, lighting.as_deref()).and_then(|(source, words)| {
            let reflection = reflect::reflect(&words).map_err(|error| format!("glsl/{name}: {error}"))?;
            Ok((source, words, reflection))
        }) {
            Ok((source, words, reflection)) => {
                let suffix = lighting.as_ref().map(|method| format!("_{method}")).unwrap_or_default();
                let file = format!("{}{suffix}.spv", emit::identifier(name));
                let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
                fs::write(out.join(&file), bytes).expect("OUT_DIR is writable");
                modules.push(emit::Module { name: name.clone(), lighting, file, source, reflection });
            }
            Err(message) => {
                failed = true;
                for line in message.lines().filter(|line| !line.trim().is_empty()) {
                    println!("cargo::error={line}");
                }
            }
        }
    }
    if failed {
        process::exit(1);
    }
    match emit::shaders(&modules).and_then(|shaders| Ok((shaders, emit::layouts(&modules)?))) {
        Ok((shaders, layouts)) => {
            fs::write(out.join("shaders.rs"), shaders).expect("OUT_DIR is writable");
            fs::write(out.join("layout.rs"), layouts).expect("OUT_DIR is writable");
        }
        Err(message) => {
            println!("cargo::error={message}");
            process::exit(1);
        }
    }
}

/// The lighting methods that have shaders, sorted.
fn lightings(root: &Path) -> Vec<String> {
    let folders = fs::read_dir(root.join("lighting")).expect("glsl/lighting is readable").flatten();
    let mut names: Vec<_> = folders
        .filter(|entry| entry.path().join("source.glsl").exists())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Every file of GLSL below `folder`, as a path relative to `root` with forward slashes.
fn collect(root: &Path, folder: &Path, entries: &mut Vec<String>) {
    for entry in fs::read_dir(folder).expect("glsl/ is readable").flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(root, &path, entries);
        } else if matches!(path.extension().and_then(|e| e.to_str()), Some("comp" | "vert" | "frag" | "glsl")) {
            let relative = path.strip_prefix(root).expect("below glsl/");
            let parts: Vec<_> = relative.components().map(|part| part.as_os_str().to_string_lossy()).collect();
            entries.push(parts.join("/"));
        }
    }
}
