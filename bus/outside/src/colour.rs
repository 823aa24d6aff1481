//! Colours, where a person looks: on a terminal, unless `NO_COLOR` is set (<https://no-color.org>).

use std::io::IsTerminal;

/// How a text is to catch the eye.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Style {
    /// Not at all.
    #[default]
    Plain,
    /// A heading.
    Head,
    /// All is well.
    Good,
    /// Something has to be done.
    Bad,
}

impl Style {
    /// The text in this style, if there are to be colours. Whatever of it is somebody else's was made printable before.
    pub fn paint(self, text: &str, colours: bool) -> String {
        let code = match self {
            Self::Plain => return text.to_owned(),
            Self::Head => "1",
            Self::Good => "32",
            Self::Bad => "31",
        };
        if colours && !text.is_empty() { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() }
    }
}

/// Whether what is written to `stream` may have colours.
pub fn on(stream: &impl IsTerminal) -> bool {
    let variable = |name: &str| std::env::var_os(name).unwrap_or_default();
    stream.is_terminal() && variable("NO_COLOR").is_empty() && variable("TERM") != "dumb"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_terminal_is_sent_colours() {
        assert_eq!(Style::Bad.paint("x", true), "\x1b[31mx\x1b[0m");
        for style in [Style::Plain, Style::Head, Style::Good, Style::Bad] {
            assert_eq!(style.paint("x", false), "x");
            assert_eq!(style.paint("", true), "");
        }
        assert!(!on(&std::fs::File::open("/dev/null").unwrap()));
    }
}
