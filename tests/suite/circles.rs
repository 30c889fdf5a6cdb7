//! No source file imports another in a circle, parents and their children included.
//!
//! An edge leads from a file to each file whose items it names by a path: in `use`, in code, in macros. A `pub use` is
//! not an edge but a signpost: a file that uses the re-exported name has an edge to the file that defines it. Tests
//! inside the files are left out.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};

/// Segments of a module's path below its crate's root; empty for the root.
type Module = Vec<String>;

/// The names that one file uses and re-exports.
#[derive(Default)]
struct Names {
    /// Absolute paths, from the crate's root.
    used: Vec<Vec<String>>,
    /// Names that the file re-exports by `pub use`, each with the path that it stands for.
    passed_on: BTreeMap<String, Vec<String>>,
}

/// Walks a file and notes every path that may lead to another file.
struct Walk<'a> {
    module: Module,
    children: &'a BTreeSet<String>,
    names: Names,
}

impl Walk<'_> {
    /// The path from the crate's root; none for paths into other crates and for names in scope.
    fn absolute(&self, path: &[String]) -> Option<Vec<String>> {
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => Some(rest.to_vec()),
            "self" => Some([&self.module, rest].concat()),
            "super" => {
                let mut base = self.module.clone();
                let ups = path.iter().take_while(|segment| *segment == "super").count();
                base.truncate(base.len().checked_sub(ups)?);
                Some([&base, &path[ups..]].concat())
            }
            child if path.len() > 1 && self.children.contains(child) => Some([&self.module, path].concat()),
            _ => None,
        }
    }

    fn note(&mut self, path: &[String]) {
        self.names.used.extend(self.absolute(path));
    }

    fn tree(&mut self, tree: &syn::UseTree, before: &[String], is_public: bool) {
        let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
        match tree {
            syn::UseTree::Path(path) => self.tree(&path.tree, &with(&path.ident), is_public),
            syn::UseTree::Group(group) => group.items.iter().for_each(|tree| self.tree(tree, before, is_public)),
            syn::UseTree::Name(name) => self.leaf(with(&name.ident), name.ident.to_string(), is_public),
            syn::UseTree::Rename(name) => self.leaf(with(&name.ident), name.rename.to_string(), is_public),
            syn::UseTree::Glob(_) => self.note(before),
        }
    }

    fn leaf(&mut self, mut path: Vec<String>, name: String, is_public: bool) {
        path.pop_if(|last| last == "self");
        match self.absolute(&path) {
            Some(target) if is_public => {
                self.names.passed_on.insert(name, target);
            }
            found => self.names.used.extend(found),
        }
    }

    /// Notes paths in a macro's tokens, which are not a syntax tree.
    fn tokens(&mut self, tokens: TokenStream) {
        let mut path: Vec<String> = Vec::new();
        for token in tokens {
            match token {
                TokenTree::Ident(name) => path.push(name.to_string()),
                TokenTree::Punct(mark) if mark.as_char() == ':' => continue,
                TokenTree::Group(group) => {
                    self.note(&std::mem::take(&mut path));
                    self.tokens(group.stream());
                }
                _ => self.note(&std::mem::take(&mut path)),
            }
        }
        self.note(&path);
    }
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    let is_cfg_test = |attribute: &syn::Attribute| match &attribute.meta {
        syn::Meta::List(list) => list.path.is_ident("cfg") && list.tokens.to_string() == "test",
        _ => false,
    };
    attributes.iter().any(is_cfg_test)
}

impl<'ast> Visit<'ast> for Walk<'_> {
    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if !is_test(&item.attrs) {
            self.tree(&item.tree, &[], !matches!(item.vis, syn::Visibility::Inherited));
        }
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if is_test(&item.attrs) || item.content.is_none() {
            return;
        }
        self.module.push(item.ident.to_string());
        visit::visit_item_mod(self, item);
        self.module.pop();
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if !is_test(&item.attrs) {
            visit::visit_item_fn(self, item);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.note(&path.segments.iter().map(|segment| segment.ident.to_string()).collect::<Vec<_>>());
        visit::visit_path(self, path);
    }

    /// `pub(super)` and `pub(crate)` restrict the use of an item; they use nothing themselves.
    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {}

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        self.tokens(item.tokens.clone());
    }
}

/// The edges between the files of one crate; `files` gives each module's text.
fn edges(files: &BTreeMap<Module, String>) -> BTreeMap<Module, BTreeSet<Module>> {
    let mut names = BTreeMap::new();
    for (module, text) in files {
        let is_child = |other: &&Module| other.len() == module.len() + 1 && other.starts_with(module);
        let children = files.keys().filter(is_child).filter_map(|other| other.last().cloned()).collect();
        let mut walk = Walk { module: module.clone(), children: &children, names: Names::default() };
        walk.visit_file(&syn::parse_file(text).unwrap());
        names.insert(module.clone(), walk.names);
    }
    let targets = |module: &Module, found: &Names| -> BTreeSet<Module> {
        let found = found.used.iter().filter_map(|path| file_of(path, &names));
        found.filter(|target| target != module).collect()
    };
    names.iter().map(|(module, found)| (module.clone(), targets(module, found))).collect()
}

/// The file that defines the item at an absolute path, after following all signposts.
fn file_of(path: &[String], names: &BTreeMap<Module, Names>) -> Option<Module> {
    let mut path = path.to_vec();
    // A circle of signposts does not compile; the bound is for broken fixtures.
    for _ in 0..16 {
        let module = (0..=path.len()).rev().map(|length| &path[..length]).find(|start| names.contains_key(*start))?;
        let rest = &path[module.len()..];
        let Some(target) = rest.first().and_then(|name| names[module].passed_on.get(name)) else {
            return Some(module.to_vec());
        };
        path = [target.as_slice(), &rest[1..]].concat();
    }
    None
}

/// One circle for each file that lies on any, as `a -> b -> a`.
fn circles(edges: &BTreeMap<Module, BTreeSet<Module>>) -> Vec<String> {
    let way_back = |start: &Module| -> Option<Vec<Module>> {
        let mut seen = BTreeSet::new();
        let mut ways = vec![vec![start.clone()]];
        while let Some(way) = ways.pop() {
            for next in way.last().and_then(|last| edges.get(last)).into_iter().flatten() {
                if next == start {
                    return Some([way, vec![start.clone()]].concat());
                }
                if seen.insert(next.clone()) {
                    ways.insert(0, [way.clone(), vec![next.clone()]].concat());
                }
            }
        }
        None
    };
    let shown = |way: Vec<Module>| way.iter().map(|module| format!("crate::{}", module.join("::"))).collect::<Vec<_>>();
    edges.keys().filter_map(way_back).map(|way| shown(way).join(" -> ")).collect()
}

/// The modules of a crate; files and folders of tests are left out.
fn modules(source: &Path) -> BTreeMap<Module, String> {
    let mut files = BTreeMap::new();
    let mut folders = vec![(source.to_owned(), Module::new())];
    while let Some((folder, module)) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
            let is_test = stem == "tests" || stem.starts_with("tests_");
            let below = [module.as_slice(), std::slice::from_ref(&stem)].concat();
            if path.is_dir() && !is_test {
                folders.push((path, below));
            } else if path.extension().is_some_and(|extension| extension == "rs") && !is_test {
                let is_root = ["mod", "lib", "main"].contains(&stem.as_str());
                files.insert(if is_root { module.clone() } else { below }, std::fs::read_to_string(&path).unwrap());
            }
        }
    }
    files
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates");
    let mut seen = 0;
    let mut found = Vec::new();
    for entry in std::fs::read_dir(crates).unwrap() {
        let folder = entry.unwrap().path();
        if !folder.join("src").is_dir() {
            continue;
        }
        let files = modules(&folder.join("src"));
        seen += files.len();
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        found.extend(circles(&edges(&files)).into_iter().map(|circle| format!("{name}: {circle}")));
    }
    assert!(seen > 250, "only {seen} files seen");
    assert_eq!(found, Vec::<String>::new(), "{} files lie on circles", found.len());
}

/// The twin: every kind of reference between files.
#[test]
fn circles_are_found() {
    let of = |files: &[(&str, &str)]| {
        let module = |name: &str| name.split("::").filter(|part| !part.is_empty()).map(str::to_owned).collect();
        circles(&edges(&files.iter().map(|(name, text)| (module(name), (*text).to_owned())).collect()))
    };
    let by_use = of(&[("", "mod a; mod b;"), ("a", "use crate::b::B;"), ("b", "use super::a::{self, A};")]);
    assert_eq!(by_use, ["crate::a -> crate::b -> crate::a", "crate::b -> crate::a -> crate::b"]);
    let by_code =
        of(&[("", "mod a; mod b;"), ("a", "fn f() { crate::b::g() }"), ("b", "fn g() { m!(super::a::f()) }")]);
    assert_eq!(by_code.len(), 2);
    let by_parent = of(&[("", "mod a;"), ("a", "mod c; pub struct S; fn f() { c::g() }"), ("a::c", "use super::S;")]);
    assert_eq!(by_parent.len(), 2);
    let signpost = of(&[("", "mod a; pub use a::A;"), ("a", "mod c; use crate::A;"), ("a::c", "pub struct C;")]);
    assert_eq!(signpost, [""; 0]);
    let behind_a_signpost =
        of(&[("", "mod a; mod b; pub use b::B;"), ("a", "use crate::B;"), ("b", "use crate::a::A;")]);
    assert_eq!(behind_a_signpost.len(), 2);
    let by_visibility = of(&[("", "mod a;"), ("a", "mod c; fn f() { c::g() }"), ("a::c", "pub(super) fn g() {}")]);
    assert_eq!(by_visibility, [""; 0]);
    let in_tests =
        of(&[("", "mod a; mod b;"), ("a", "use crate::b::B;"), ("b", "#[cfg(test)] mod t { use crate::a::A; }")]);
    assert_eq!(in_tests, [""; 0]);
}
