//! What a page has its reader do: the commands in its blocks of code, and the snippets of a language.

/// A part of a page whose commands are given one after another.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Part {
    /// The heading above.
    pub title: String,
    /// What runs in another terminal meanwhile: While `…` runs.
    pub beside: Option<String>,
    pub commands: Vec<Command>,
}

/// A command, and what the page says that it shows.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Command {
    pub line: String,
    pub shown: Vec<String>,
}

impl Command {
    fn new(line: &str) -> Self {
        Self { line: line.to_owned(), shown: Vec::new() }
    }
}

/// The parts of a page in Markdown. A part begins with a heading, and where something is to be started beside.
pub fn parts(markdown: &str) -> Vec<Part> {
    let mut parts = vec![Part::default()];
    let mut fence: Option<&str> = None;
    for line in markdown.lines() {
        let part = parts.last_mut().unwrap();
        match (fence, line.strip_prefix("```")) {
            (None, Some(language)) => fence = Some(language),
            (Some(_), Some(_)) => fence = None,
            (Some("console"), None) => match (line.strip_prefix("$ "), part.commands.last_mut()) {
                (Some(command), _) => part.commands.push(Command::new(command)),
                (None, Some(last)) => last.shown.push(line.to_owned()),
                (None, None) => panic!("no command shows {line:?}"),
            },
            (Some(_), None) => {}
            (None, None) => match line.strip_prefix("    ").map(str::trim_start) {
                Some(code) if !code.starts_with('#') => part.commands.push(Command::new(code)),
                Some(_) => {}
                None if line.starts_with('#') => {
                    parts.push(Part { title: line.trim_start_matches(['#', ' ']).to_owned(), ..Part::default() });
                }
                None => {
                    if let Some(beside) = between(line, "While `", "` runs") {
                        let title = part.title.clone();
                        parts.push(Part { title, beside: Some(beside.to_owned()), ..Part::default() });
                    }
                }
            },
        }
    }
    parts
}

/// The snippets in a language.
pub fn snippets<'a>(markdown: &'a str, language: &str) -> Vec<&'a str> {
    let fence = format!("```{language}\n");
    markdown.split(&fence).skip(1).map(|rest| rest.split_once("\n```").unwrap().0).collect()
}

/// The examples in a command's help: after the word, each in a line of its own or behind four spaces. A backslash at the
/// end goes on in the next line.
pub fn examples(help: &str) -> Vec<Command> {
    let (mut found, mut is_example) = (Vec::new(), false);
    let help: String = help.split("\\\n").map(str::trim_start).collect();
    for line in help.lines() {
        let begins = line.strip_prefix("Example: ").or_else(|| line.strip_prefix("Examples: "));
        is_example = begins.is_some() || is_example && line.starts_with("    ");
        if is_example {
            let commands = begins.unwrap_or(line).split("    ").map(str::trim).filter(|line| !line.is_empty());
            found.extend(commands.map(Command::new));
        }
    }
    found
}

fn between<'a>(text: &'a str, before: &str, after: &str) -> Option<&'a str> {
    Some(text.split_once(before)?.1.split_once(after)?.0)
}

#[test]
fn commands_are_found_in_blocks_of_either_kind_and_in_help() {
    let page = "# One\n\n    elk a  # says\n           # a\n\nWhile `elk b` runs:\n\n```console\n$ elk c\nfound\n```\n\
                ```rust\n$ nothing\n```\n## Two\n";
    let shown = vec!["found".to_owned()];
    let part = |title: &str, beside: Option<&str>, commands| Part {
        title: title.into(),
        beside: beside.map(str::to_owned),
        commands,
    };
    let one = part("One", None, vec![Command::new("elk a  # says")]);
    let beside = part("One", Some("elk b"), vec![Command { shown, ..Command::new("elk c") }]);
    assert_eq!(parts(page), [Part::default(), one, beside, part("Two", None, vec![])]);
    assert_eq!(snippets(page, "rust"), ["$ nothing"]);
    let help =
        "Usage: elk d\n\nExamples: elk d    elk d 1 \\\n  --more\n          elk d 2\n\nNothing\n\nExample: elk d 3\n";
    assert_eq!(examples(help), ["elk d", "elk d 1 --more", "elk d 2", "elk d 3"].map(Command::new));
}
