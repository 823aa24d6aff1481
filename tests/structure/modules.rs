//! The modules of a crate, and what each names of the others.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

use crate::graph::Graph;

/// The path of a module from its crate's root, which is the empty one; or of an item.
type Names = Vec<String>;

/// A module as its text has it.
#[derive(Debug, Default)]
struct Module {
    /// The module whose file it stands in: itself, unless it is written inline.
    home: Names,
    /// What it declares by itself, modules included.
    declared: BTreeSet<String>,
    /// What it imports or re-exports: by which name, and what.
    imported: BTreeMap<String, Names>,
    /// What it imports all of.
    globs: Vec<Names>,
    /// All that it names, with the line.
    named: Vec<(Names, usize)>,
}

/// A crate's modules by their paths.
#[derive(Debug)]
pub struct Crate {
    modules: BTreeMap<Names, Module>,
}

impl Crate {
    /// Reads a crate from its root file, module by module.
    pub fn read(root: &Path) -> io::Result<Self> {
        let mut reader = Reader { modules: BTreeMap::new() };
        reader.file(root, &[], root.parent().unwrap_or(Path::new("")))?;
        Ok(Self { modules: reader.modules })
    }

    /// The modules that have a file each.
    pub fn rooms(&self) -> impl Iterator<Item = &[String]> {
        self.modules.iter().filter(|(path, module)| **path == module.home).map(|(path, _)| path.as_slice())
    }

    /// The arrows between a module and the modules of its folder, each taken with all that lies in it.
    pub fn arrows_in(&self, room: &[String]) -> Graph {
        let mut graph = Graph::default();
        for (path, module) in self.modules.iter().filter(|(_, module)| module.home.starts_with(room)) {
            for (named, line) in &module.named {
                let Some(target) = self.home_of(path, named).filter(|target| target.starts_with(room)) else {
                    continue;
                };
                let place = format!("{} (line {line} of {})", named.join("::"), shown(&module.home));
                graph.arrow(&branch(room, &module.home), &branch(room, &target), &place);
            }
        }
        graph
    }

    /// The module whose file defines what `named` says in the module `here`; `None`: it is no item of this crate.
    fn home_of(&self, here: &[String], named: &[String]) -> Option<Names> {
        let found = self.follow(here, named, 0)?;
        Some(self.modules[&found].home.clone())
    }

    /// The module that defines it. `depth` bounds imports that go round.
    fn follow(&self, here: &[String], named: &[String], depth: usize) -> Option<Names> {
        let (mut at, rest) = self.start(here, named)?;
        for (index, name) in rest.iter().enumerate() {
            let module = self.modules.get(&at)?;
            let inner: Names = at.iter().chain([name]).cloned().collect();
            if self.modules.contains_key(&inner) {
                at = inner;
            } else if module.declared.contains(name) || depth > 8 {
                return Some(at);
            } else if let Some(imported) = module.imported.get(name) {
                let onwards: Names = imported.iter().chain(&rest[index + 1..]).cloned().collect();
                return self.follow(&at, &onwards, depth + 1);
            } else {
                let through = |glob: &Names| {
                    let onwards: Names = glob.iter().chain(&rest[index..]).cloned().collect();
                    self.follow(&at, &onwards, depth + 1).filter(|found| *found != at)
                };
                return module.globs.iter().find_map(through).or(Some(at));
            }
        }
        Some(at)
    }

    /// Where a path begins, and what of it is left to follow.
    fn start<'a>(&self, here: &[String], named: &'a [String]) -> Option<(Names, &'a [String])> {
        let (first, rest) = named.split_first()?;
        match first.as_str() {
            "crate" => Some((Vec::new(), rest)),
            "self" => Some((here.to_vec(), rest)),
            "super" => {
                let supers = named.iter().take_while(|name| *name == "super").count();
                Some((here[..here.len().checked_sub(supers)?].to_vec(), &named[supers..]))
            }
            name => {
                let module = &self.modules[here];
                let inner: Names = here.iter().cloned().chain([name.to_owned()]).collect();
                let known =
                    self.modules.contains_key(&inner) || module.imported.get(name).is_some_and(|to| to[0] != name);
                known.then(|| (here.to_vec(), named))
            }
        }
    }
}

/// The module itself, or the branch of its folder, that `module` lies in.
fn branch(room: &[String], module: &[String]) -> String {
    shown(&module[..module.len().min(room.len() + 1)])
}

fn shown(module: &[String]) -> String {
    if module.is_empty() { "the root".to_owned() } else { module.join("::") }
}

struct Reader {
    modules: BTreeMap<Names, Module>,
}

impl Reader {
    /// Reads a module's file; its inner modules lie in `folder`.
    fn file(&mut self, file: &Path, path: &[String], folder: &Path) -> io::Result<()> {
        let text = fs::read_to_string(file)?;
        let tokens: TokenStream =
            text.parse().map_err(|error| io::Error::other(format!("{}: {error}", file.display())))?;
        self.module(tokens, path, path, folder)
    }

    fn module(&mut self, tokens: TokenStream, path: &[String], home: &[String], folder: &Path) -> io::Result<()> {
        self.modules.insert(path.to_vec(), Module { home: home.to_vec(), ..Module::default() });
        self.tokens(&tokens.into_iter().collect::<Vec<_>>(), path, home, folder, true)
    }

    /// Reads a module's text, or (not `outermost`) a block, a list or a macro's text in it.
    fn tokens(
        &mut self,
        tokens: &[TokenTree],
        path: &[String],
        home: &[String],
        folder: &Path,
        outermost: bool,
    ) -> io::Result<()> {
        let mut at = 0;
        while at < tokens.len() {
            let rest = &tokens[at..];
            if is_for_tests(rest) {
                at += 2 + item_len(&rest[2..]);
            } else if is_word(rest.first(), "use") {
                let len = rest.iter().position(|token| is_punct(token, ';')).unwrap_or(rest.len());
                self.import(&rest[1..len], path, &[]);
                at += len;
            } else if outermost
                && is_word(rest.first(), "mod")
                && let Some(name) = word(rest.get(1))
            {
                self.inner(&name, rest.get(2), path, home, folder)?;
                at += 3;
            } else if let Some((named, len)) = path_at(rest) {
                if named.len() > 1 {
                    let line = rest[0].span().start().line;
                    self.modules.get_mut(path).expect("read above").named.push((named, line));
                }
                at += len;
            } else {
                if outermost && let Some(name) = declaration(rest) {
                    self.modules.get_mut(path).expect("read above").declared.insert(name);
                }
                if let TokenTree::Group(group) = &rest[0] {
                    let inner: Vec<TokenTree> = group.stream().into_iter().collect();
                    self.tokens(&inner, path, home, folder, false)?;
                }
                at += 1;
            }
        }
        Ok(())
    }

    /// An inner module: inline if a block follows its name.
    fn inner(
        &mut self,
        name: &str,
        next: Option<&TokenTree>,
        path: &[String],
        home: &[String],
        folder: &Path,
    ) -> io::Result<()> {
        let inner: Names = path.iter().cloned().chain([name.to_owned()]).collect();
        let folder = folder.join(name);
        match next {
            Some(TokenTree::Group(block)) => self.module(block.stream(), &inner, home, &folder),
            _ => {
                let flat = folder.with_extension("rs");
                let file: PathBuf = if flat.exists() { flat } else { folder.join("mod.rs") };
                self.file(&file, &inner, &folder)
            }
        }
    }

    /// An import's tree behind `prefix`.
    fn import(&mut self, tree: &[TokenTree], path: &[String], prefix: &[String]) {
        let Some(first) = tree.first() else { return };
        let mut names = prefix.to_vec();
        let mut at = 0;
        while let Some(name) = word(tree.get(at)) {
            names.push(name);
            at += 1;
            if !is_path_sign(&tree[at..]) {
                break;
            }
            at += 2;
        }
        let module = self.modules.get_mut(path).expect("read above");
        let line = first.span().start().line;
        match tree.get(at) {
            Some(TokenTree::Group(list)) => {
                let list: Vec<TokenTree> = list.stream().into_iter().collect();
                list.split(|token| is_punct(token, ',')).for_each(|branch| self.import(branch, path, &names));
            }
            Some(token) if is_punct(token, '*') => {
                module.named.push((names.clone(), line));
                module.globs.push(names);
            }
            renamed => {
                if names.last().is_some_and(|last| last == "self") {
                    names.pop();
                }
                let renamed = if is_word(renamed, "as") { word(tree.get(at + 1)) } else { None };
                module.named.push((names.clone(), line));
                if let Some(name) = renamed.or(names.last().cloned()) {
                    module.imported.insert(name, names);
                }
            }
        }
    }
}

/// The path that begins here, and how many tokens it takes.
fn path_at(tokens: &[TokenTree]) -> Option<(Names, usize)> {
    let mut names = vec![word(tokens.first())?];
    let mut at = 1;
    while is_path_sign(&tokens[at..])
        && let Some(name) = word(tokens.get(at + 2))
    {
        names.push(name);
        at += 3;
    }
    (names.len() > 1).then_some((names, at))
}

/// Whether an attribute begins here that leaves the item behind it to tests.
fn is_for_tests(tokens: &[TokenTree]) -> bool {
    let [sign, TokenTree::Group(attribute), ..] = tokens else { return false };
    is_punct(sign, '#') && attribute.stream().to_string().replace(' ', "") == "cfg(test)"
}

/// How many tokens an item takes: up to its block or its semicolon.
fn item_len(tokens: &[TokenTree]) -> usize {
    let ends = |token: &TokenTree| match token {
        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
        token => is_punct(token, ';'),
    };
    tokens.iter().position(ends).map_or(tokens.len(), |end| end + 1)
}

/// The name of the item that is declared here.
fn declaration(tokens: &[TokenTree]) -> Option<String> {
    const KINDS: [&str; 8] = ["fn", "struct", "enum", "trait", "type", "const", "static", "union"];
    match word(tokens.first())?.as_str() {
        "macro_rules" => word(tokens.get(2)),
        kind if KINDS.contains(&kind) => word(tokens.get(1)),
        _ => None,
    }
}

fn word(token: Option<&TokenTree>) -> Option<String> {
    match token? {
        TokenTree::Ident(name) => Some(name.to_string()),
        _ => None,
    }
}

fn is_word(token: Option<&TokenTree>, word: &str) -> bool {
    matches!(token, Some(TokenTree::Ident(name)) if name == word)
}

fn is_punct(token: &TokenTree, sign: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == sign)
}

fn is_path_sign(tokens: &[TokenTree]) -> bool {
    matches!(tokens, [TokenTree::Punct(first), second, ..]
        if first.as_char() == ':' && first.spacing() == Spacing::Joint && is_punct(second, ':'))
}
