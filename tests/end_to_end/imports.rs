//! Claim: imports go one way. No file of a crate imports, over any number of others, itself.
//!
//! Read from the sources: `use` statements and paths that begin with `crate` or `super`, without
//! tests. A module and the modules inside it count as one: a parent may re-export its children, and
//! children may use its types.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

/// Crates that are checked.
const CRATES: [&str; 13] = [
    "vision",
    "map",
    "formats",
    "protos",
    "ros2",
    "recordings",
    "sim",
    "link",
    "client",
    "engine",
    "server",
    "cli",
    "lab",
];

/// A module by its path in the crate: `["recognise", "alignment"]`.
type Module = Vec<String>;

/// The modules of a crate with their sources, without those of tests.
fn modules(name: &str) -> BTreeMap<Module, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name).join("src");
    let (mut found, mut folders): (BTreeMap<Module, String>, Vec<PathBuf>) =
        (BTreeMap::new(), vec![root.clone()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            let stem = path.file_stem().and_then(|s| s.to_str()).expect("a name").to_owned();
            if path.is_dir() {
                folders.extend((stem != "tests").then_some(path));
            } else if path.extension().is_some_and(|e| e == "rs") && !stem.ends_with("tests") {
                let relative = path.strip_prefix(&root).expect("inside").with_extension("");
                let mut module: Module =
                    relative.iter().map(|part| part.to_str().expect("UTF-8").to_owned()).collect();
                if module.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
                    module.pop();
                }
                found.insert(module, code(&fs::read_to_string(&path).expect("a source in UTF-8")));
            }
        }
    }
    found
}

/// A source without comments and without its tests.
fn code(source: &str) -> String {
    let is_tests =
        |at: usize| source[at..].lines().nth(1).is_some_and(|l| l.contains("mod ") && l.ends_with('{'));
    let end = source.match_indices("#[cfg(test)]\n").map(|(at, _)| at).find(|at| is_tests(*at));
    let end = end.unwrap_or(source.len());
    let lines = source[..end].lines().map(|line| line.split("//").next().unwrap_or(""));
    lines.collect::<Vec<_>>().join("\n")
}

/// The paths of a `use` tree: `a::{b, c::d}` is `a::b` and `a::c::d`.
fn leaves(tree: &str, before: &[String], paths: &mut Vec<Module>) {
    let (mut depth, mut start) = (0_i32, 0);
    let mut parts = Vec::new();
    for (i, character) in tree.char_indices() {
        match character {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&tree[start..i]);
                start = i + 1;
            }
            _ => {}
        }
    }
    parts.push(&tree[start..]);
    for part in parts.iter().map(|p| p.trim()).filter(|p| !p.is_empty()) {
        let (head, inner) = part.split_once('{').map_or((part, None), |(h, i)| (h, i.rsplit_once('}')));
        let mut path = before.to_vec();
        let head = head.split(" as ").next().unwrap_or("");
        path.extend(head.split("::").map(str::trim).filter(|s| !s.is_empty()).map(str::to_owned));
        match inner {
            Some((inner, _)) => leaves(inner, &path, paths),
            None => paths.push(path),
        }
    }
}

/// Every path that a source names: in `use` statements, and in the code from `crate` or `super` on.
fn paths(source: &str) -> Vec<Module> {
    let mut found = Vec::new();
    for statement in source.split("use ").skip(1) {
        leaves(statement.split(';').next().unwrap_or(""), &[], &mut found);
    }
    for start in ["crate::", "super::"] {
        for (at, _) in source.match_indices(start) {
            let is_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
            let text: String = source[at..].chars().take_while(|c| is_path(*c)).collect();
            found.push(text.split("::").filter(|s| !s.is_empty()).map(str::to_owned).collect());
        }
    }
    found
}

/// The module of the crate that a path leads to.
fn target(path: &[String], from: &Module, modules: &BTreeMap<Module, String>) -> Option<Module> {
    let supers = path.iter().take_while(|part| *part == "super").count();
    let absolute: Module = match path.first()?.as_str() {
        "crate" => path[1..].to_vec(),
        "super" => from[..from.len().checked_sub(supers)?].iter().chain(&path[supers..]).cloned().collect(),
        "self" => from.iter().chain(&path[1..]).cloned().collect(),
        _ => return None,
    };
    (1..=absolute.len()).rev().map(|n| absolute[..n].to_vec()).find(|module| modules.contains_key(module))
}

/// Whether one is the other or inside it.
fn is_inside(a: &Module, b: &Module) -> bool {
    a.starts_with(b) || b.starts_with(a)
}

/// All modules that can be reached from one.
fn reached(from: &Module, imports: &BTreeMap<Module, BTreeSet<Module>>) -> BTreeSet<Module> {
    let (mut visited, mut open) = (BTreeSet::new(), vec![from.clone()]);
    while let Some(module) = open.pop() {
        for next in imports.get(&module).into_iter().flatten() {
            if visited.insert(next.clone()) {
                open.push(next.clone());
            }
        }
    }
    visited
}

fn cycles(modules: &BTreeMap<Module, String>) -> Vec<BTreeSet<Module>> {
    let of = |module: &Module, source: &String| -> BTreeSet<Module> {
        let all = paths(source).into_iter().filter_map(|p| target(&p, module, modules));
        all.filter(|to| !is_inside(to, module)).collect()
    };
    let imports: BTreeMap<Module, BTreeSet<Module>> =
        modules.iter().map(|(m, s)| (m.clone(), of(m, s))).collect();
    let reach: BTreeMap<&Module, BTreeSet<Module>> =
        modules.keys().map(|m| (m, reached(m, &imports))).collect();
    let mut found: Vec<BTreeSet<Module>> = Vec::new();
    for (module, all) in reach.iter().filter(|(module, all)| all.contains(**module)) {
        let circle: BTreeSet<Module> = all.iter().filter(|m| reach[m].contains(*module)).cloned().collect();
        if !found.contains(&circle) {
            found.push(circle);
        }
    }
    found
}

#[test]
fn imports_go_one_way() {
    let mut wrong = Vec::new();
    for name in CRATES {
        let modules = modules(name);
        assert!(!modules.is_empty(), "{name} has no sources");
        for circle in cycles(&modules) {
            wrong.push(format!("{name}: {:?}", circle.iter().map(|m| m.join("/")).collect::<Vec<_>>()));
        }
    }
    assert!(wrong.is_empty(), "files that import each other: {wrong:#?}");
}

#[test]
fn a_cycle_is_found_and_a_parent_is_none() {
    let module = |text: &str| text.split('/').map(str::to_owned).collect::<Module>();
    let crate_of =
        |sources: &[(&str, &str)]| sources.iter().map(|(m, s)| (module(m), (*s).to_owned())).collect();
    let circle = crate_of(&[
        ("a", "use crate::b::{X, y::Z};"),
        ("b", "use super::c::W;"),
        ("b/y", "use crate::b::X;"),
        ("c", "fn f() { crate::a::g() }"),
    ]);
    assert_eq!(cycles(&circle), [BTreeSet::from(["a", "b", "c"].map(module))]);
    let parent =
        crate_of(&[("a", "mod b; use b::X;"), ("a/b", "use super::Y;"), ("c", "use crate::a::b::X;")]);
    assert!(cycles(&parent).is_empty());
}
