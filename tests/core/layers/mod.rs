//! Data flows one way: cli, output, validate, map, gpu, record, dynamics. No source names a layer above its own.

mod code;
mod paths;

use std::fs;
use std::path::{Path, PathBuf};

use paths::named;

/// The library's layers, lowest first. A new folder in `src` is put in its place here. Below them all lie the
/// modules of `rattlemap-dynamics`, a package of its own.
const LAYERS: [&str; 11] =
    ["record", "gpu", "text", "model_file", "map", "findings", "validate", "show", "store", "job", "cli"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every Rust source in a folder.
pub(crate) fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found
}

/// The module of a source, by its path below `src`: `gpu/pool.rs` and `gpu/pool/mod.rs` are `gpu::pool`.
fn module_of(path: &Path) -> Vec<String> {
    let parts = path.with_extension("");
    let mut parts: Vec<String> = parts.iter().map(|part| part.to_str().unwrap().to_owned()).collect();
    if parts.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
        parts.pop();
    }
    parts
}

/// What a source of the library at `path` names and must not: a layer above its own, or all of them at once.
fn arrows_up(path: &Path, text: &str) -> Vec<String> {
    let module = module_of(path);
    let Some(own) = module.first().and_then(|first| LAYERS.iter().position(|layer| layer == first)) else {
        return vec![format!("{}: in no layer", path.display())];
    };
    let above = |name: &str| name == "*" || LAYERS[own + 1..].contains(&name);
    let wrong = named(text, &module).into_iter().filter(|(name, _)| above(name));
    wrong.map(|(name, line)| format!("{}:{line}: {} names {name}", path.display(), LAYERS[own])).collect()
}

#[test]
fn no_source_names_a_layer_above_its_own() {
    let folder = root().join("src");
    let mut wrong = Vec::new();
    let mut seen = [0; LAYERS.len()];
    for source in sources(&folder) {
        let path = source.strip_prefix(&folder).unwrap();
        // The roots of library and program see every layer.
        if module_of(path).is_empty() {
            continue;
        }
        wrong.extend(arrows_up(path, &fs::read_to_string(&source).unwrap()));
        if let Some(layer) = LAYERS
            .iter()
            .position(|layer| path.starts_with(layer) || path.with_extension("") == Path::new(layer))
        {
            seen[layer] += 1;
        }
    }
    assert!(wrong.is_empty(), "arrows that lead up:\n{}", wrong.join("\n"));
    assert!(seen.iter().all(|&files| files > 0), "a layer without files: {seen:?} of {LAYERS:?}");
}

/// Cargo forbids `rattlemap` there; what is left are packages for files, clocks, threads and graphics.
#[test]
fn dynamics_knows_no_file_clock_thread_or_graphics() {
    let folder = root().join("dynamics/src");
    let sources = sources(&folder);
    assert!(sources.len() > 20, "{sources:?}");
    let foreign = ["fs", "io", "net", "path", "process", "thread", "time"];
    for source in sources {
        let text = fs::read_to_string(&source).unwrap();
        let names: Vec<_> = code::tokens(&text).into_iter().map(|(token, _)| token).collect();
        for three in names.windows(3) {
            if let [code::Token::Name("std"), code::Token::PathSeparator, code::Token::Name(name)] = three {
                assert!(!foreign.contains(name), "{} names std::{name}", source.display());
            }
        }
    }
    let manifest = fs::read_to_string(root().join("dynamics/Cargo.toml")).unwrap();
    let dependencies = manifest.split("[dependencies]").nth(1).unwrap().split("\n[").next().unwrap();
    let names: Vec<_> = dependencies.lines().filter_map(|line| line.split(['.', ' ', '=']).next()).collect();
    let names: Vec<_> = names.into_iter().filter(|name| !name.is_empty() && !name.starts_with('#')).collect();
    assert_eq!(names, ["nalgebra", "thiserror", "wide"]);
}

/// What the check above must find, wherever it is planted.
#[test]
fn planted_arrows_are_found() {
    let planted = [
        "use crate::map::plan::Plan;",
        "pub(crate) use crate::map;",
        "use crate::{\n    record::Record,\n    map::{plan::Plan, scene},\n};",
        "use crate::{record::{Record, valid}, cli};",
        "fn f() { let plan = crate::map::plan::Plan::new(); }",
        "impl From<crate::validate::Report> for u8 {}",
        "println!(\"{}\", crate::store::folder::NAME);",
        "use super::super::map::plan;",
        "mod tests { use super::super::super::map; }",
        "mod tests { fn f() {} mod deeper { use super::super::super::super::map; } }",
        "/* a /* nested */ comment */ use crate::map;",
        "const QUOTE: char = '\"'; use crate::map; const OTHER: char = '\"';",
        "fn f<'a>(x: &'a str) -> &'a str { crate::map::name(x) }",
        "const RAW: &str = r#\"\"\"#; use crate::map;",
        "use crate::*;",
        "use crate as root; use root::map;",
        "use crate::{self as root}; use root::map;",
    ];
    for text in planted {
        let found = arrows_up(Path::new("gpu/pool.rs"), text);
        assert_eq!(found.len(), 1, "{text}: {found:?}");
    }
    let line = arrows_up(Path::new("gpu/mod.rs"), "use std::fmt;\n\nuse super::map;\n");
    assert_eq!(line, ["gpu/mod.rs:3: gpu names map"]);
    assert_eq!(arrows_up(Path::new("curves/fold.rs"), ""), ["curves/fold.rs: in no layer"]);
}

#[test]
fn arrows_down_and_mere_words_are_allowed() {
    let allowed = [
        "use crate::record::{Record, valid};",
        "use crate::{gpu::pool, model::State, record::Record};",
        "pub(crate) fn f() {} pub(in crate::gpu) fn g() {}",
        "//! See [`crate::map`].\n/// As `crate::map::Plan`.\nfn f() {}",
        "const TEXT: &str = \"use crate::map;\"; const RAW: &str = r#\"crate::map \" crate::cli\"#;",
        "use super::map; fn map() { other::crate_::map(); }",
        "mod tests { use super::super::map; }",
        "mod a {} mod b { use super::map; } fn after() { super::map(); }",
    ];
    for text in allowed {
        let found = arrows_up(Path::new("gpu/pool.rs"), text);
        assert!(found.is_empty(), "{text}: {found:?}");
    }
}
