//! Imports go down only: no layer of `src` names a layer above its own. `dynamics` is a package of its own with few
//! dependencies.

use std::fs;
use std::path::{Path, PathBuf};

/// The folders of `src`, lowest layer first.
const LAYERS: [&str; 11] =
    ["record", "gpu", "text", "model_file", "map", "findings", "validate", "show", "store", "job", "cli"];

/// Modules of the standard library that `dynamics` and `show` must not use: they need files, clocks, threads or a network.
const IMPURE: [&str; 6] = ["std::fs", "std::net", "std::path", "std::process", "std::thread", "std::time"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Lists every Rust source in a folder and below.
pub(crate) fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let within = |path: PathBuf| if path.is_dir() { sources(&path) } else { vec![path] };
    let files = entries.flat_map(within);
    files.filter(|path| path.extension().is_some_and(|extension| extension == "rs")).collect()
}

/// Returns the code of a source, without its comments and without unit tests that follow it.
fn code(source: &Path) -> String {
    let text = fs::read_to_string(source).unwrap();
    let lines = text.lines().take_while(|line| *line != "mod tests {");
    lines.filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// Lists the layers above `own` that the code names.
fn upward(own: usize, code: &str) -> Vec<&'static str> {
    let names = |layer: &&str| {
        let path = format!("crate::{layer}");
        code.match_indices(&path).any(|(at, _)| {
            let after = code[at + path.len()..].chars().next();
            after.is_none_or(|c| !c.is_alphanumeric() && c != '_')
        })
    };
    LAYERS[own + 1..].iter().copied().filter(names).collect()
}

#[test]
fn no_layer_names_a_layer_above_its_own() {
    let mut wrong = Vec::new();
    for folder in fs::read_dir(root().join("src")).unwrap().map(|entry| entry.unwrap().path()) {
        if !folder.is_dir() {
            continue;
        }
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        let own = LAYERS.iter().position(|layer| *layer == name);
        let own = own.unwrap_or_else(|| panic!("src/{name} is in no layer"));
        for source in sources(&folder) {
            let code = code(&source);
            // A list or a wildcard at the root would hide a name.
            let module = source.strip_prefix(root().join("src")).unwrap().with_extension("");
            let depth = module.iter().filter(|part| *part != "mod").count();
            for hidden in ["crate::{", "crate::*", "use crate as", &"super::".repeat(depth)] {
                assert!(!code.contains(hidden), "{}: {hidden}", source.display());
            }
            wrong
                .extend(upward(own, &code).iter().map(|above| format!("{} names {above}", source.display())));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Returns the code of a module of `dynamics` and of the files in its folder.
fn module(name: &str) -> String {
    let file = root().join(format!("dynamics/src/{name}.rs"));
    let folder = root().join("dynamics/src").join(name);
    let parts = if folder.is_dir() { sources(&folder) } else { Vec::new() };
    parts.iter().chain([&file]).map(|source| code(source)).collect::<Vec<_>>().join("\n")
}

/// The engines stand side by side, below what classifies motion, and one file knows both.
#[test]
fn the_engines_of_dynamics_do_not_know_each_other() {
    let above = ["orbit", "stability", "motion::Trajectory", "motion::Flow"];
    for (engine, other) in [("pair", "machine"), ("machine", "pair")] {
        let code = module(engine);
        for name in above.iter().chain([&other]) {
            assert!(!code.contains(&format!("crate::{name}")), "{engine} names {name}");
        }
    }
    for below in ["allowance", "clock", "event", "slip", "sums"] {
        let code = module(&format!("motion/{below}"));
        assert!(
            !["pair", "machine"].iter().any(|engine| code.contains(&format!("crate::{engine}"))),
            "{below}"
        );
    }
    for above in ["orbit", "stability", "word"] {
        assert!(
            !["pair", "machine"].iter().any(|engine| module(above).contains(&format!("crate::{engine}"))),
            "{above}"
        );
    }
}

#[test]
fn an_upward_import_is_found() {
    let gpu = LAYERS.iter().position(|layer| *layer == "gpu").unwrap();
    assert_eq!(upward(gpu, "use crate::map::plan::Plan;\nuse crate::record;"), ["map"]);
    assert!(upward(gpu, "use crate::record::Record; use crate::mapping;").is_empty());
}

#[test]
fn dynamics_and_show_use_no_files_clocks_or_threads() {
    for folder in ["dynamics/src", "src/show"] {
        let sources = sources(&root().join(folder));
        assert!(sources.len() > 20, "{sources:?}");
        for source in sources {
            let code = code(&source);
            let found = IMPURE.iter().find(|module| code.contains(*module));
            assert!(found.is_none(), "{} uses {found:?}", source.display());
            assert!(folder == "src/show" || !code.contains("std::io"), "{} uses std::io", source.display());
        }
    }
    let manifest = fs::read_to_string(root().join("dynamics/Cargo.toml")).unwrap();
    let dependencies = manifest.split("[dependencies]").nth(1).unwrap().split("\n[").next().unwrap();
    let names = dependencies.lines().filter_map(|line| line.split(['.', ' ', '=']).next());
    let names: Vec<_> = names.filter(|name| !name.is_empty() && !name.starts_with('#')).collect();
    assert_eq!(names, ["nalgebra", "thiserror", "wide"]);
}
