//! Arguments in one text, taken apart as a shell does, without a shell: white space separates, quotes and `\` hold
//! together, and nothing is expanded or left out (a `#` begins no comment).

/// Why a text is no list of arguments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ArgumentsError {
    /// A quote has no end.
    #[error(
        "the {quote} at letter {letter} is not closed; right is one more {quote}, or \\{quote} for the letter itself"
    )]
    Open {
        /// `'` or `"`.
        quote: char,
        /// Where it stands in the text, from 1.
        letter: usize,
    },
    /// Nothing comes behind the last `\`.
    #[error("it ends with a \\, which takes the letter behind it as it is; right is \\\\ for the letter itself")]
    Backslash,
}

/// The arguments that `text` lists. White space separates them. Within `'…'` every letter is itself; within `"…"` as
/// well, but for `\"` and `\\`, which are `"` and `\`; elsewhere `\` makes the letter behind it itself.
///
/// # Errors
/// A quote, or a `\`, that has no end.
pub fn split_arguments(text: &str) -> Result<Vec<String>, ArgumentsError> {
    let mut arguments = Vec::new();
    // `''` is an argument, nothing is none.
    let mut argument: Option<String> = None;
    let mut letters = (1..).zip(text.chars());
    while let Some((at, letter)) = letters.next() {
        if letter.is_whitespace() {
            arguments.extend(argument.take());
            continue;
        }
        let argument = argument.get_or_insert_default();
        match letter {
            '\'' | '"' => quoted(letter, at, &mut letters, argument)?,
            '\\' => argument.push(letters.next().ok_or(ArgumentsError::Backslash)?.1),
            _ => argument.push(letter),
        }
    }
    arguments.extend(argument);
    Ok(arguments)
}

/// The text of which [`split_arguments`] makes these arguments.
pub fn join_arguments<T: AsRef<str>>(arguments: &[T]) -> String {
    let plain = |c: char| !c.is_whitespace() && !"'\"\\".contains(c);
    let one = |argument: &T| match argument.as_ref() {
        argument if !argument.is_empty() && argument.chars().all(plain) => argument.to_owned(),
        argument => format!("'{}'", argument.replace('\'', r"'\''")),
    };
    arguments.iter().map(one).collect::<Vec<_>>().join(" ")
}

/// Takes what stands up to the end of a quote that was opened at letter `at`.
fn quoted(
    quote: char,
    at: usize,
    letters: &mut impl Iterator<Item = (usize, char)>,
    argument: &mut String,
) -> Result<(), ArgumentsError> {
    let open = ArgumentsError::Open { quote, letter: at };
    loop {
        match letters.next().ok_or(open)?.1 {
            letter if letter == quote => return Ok(()),
            '\\' if quote == '"' => match letters.next().ok_or(open)?.1 {
                letter @ ('"' | '\\') => argument.push(letter),
                letter => argument.extend(['\\', letter]),
            },
            letter => argument.push(letter),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn split(text: &str) -> Vec<String> {
        split_arguments(text).unwrap()
    }

    #[test]
    fn spaces_stand_in_quotes_and_behind_a_backslash() {
        assert_eq!(
            split(r#"--title 'Front camera' --pose "1 2 3" --out my\ file.txt"#),
            ["--title", "Front camera", "--pose", "1 2 3", "--out", "my file.txt"]
        );
        assert_eq!(split(r#" a'b c'"d e"\"f  '' "#), [r#"ab cd e"f"#, ""]);
        assert_eq!(
            split(r#""a\"b\\c\d" '\' it\'s $HOME *.x #no-comment"#),
            [r#"a"b\c\d"#, r"\", "it's", "$HOME", "*.x", "#no-comment"]
        );
        assert_eq!(split(" \t\n "), [""; 0]);
    }

    #[test]
    fn what_has_no_end_is_said_with_its_location() {
        let said = |text: &str| split_arguments(text).unwrap_err().to_string();
        assert_eq!(said("ä 'b"), "the ' at letter 3 is not closed; right is one more ', or \\' for the letter itself");
        assert_eq!(split_arguments(r#"x "b\""#), Err(ArgumentsError::Open { quote: '"', letter: 3 }));
        assert_eq!(split_arguments(r#""\"#), Err(ArgumentsError::Open { quote: '"', letter: 1 }));
        assert_eq!(split_arguments(r"a \"), Err(ArgumentsError::Backslash));
    }

    proptest! {
        #[test]
        fn quoted_arguments_come_back(arguments in proptest::collection::vec("[ a\\\\\"'#$ä\n]{0,6}", 0..6)) {
            let single = |argument: &String| format!("'{}'", argument.replace('\'', r"'\''"));
            let double = |argument: &String| format!("\"{}\"", argument.replace('\\', r"\\").replace('"', "\\\""));
            let join = |quote: &dyn Fn(&String) -> String| arguments.iter().map(quote).collect::<Vec<_>>().join(" ");
            prop_assert_eq!(split(&join(&single)), arguments.clone());
            prop_assert_eq!(split(&join(&double)), arguments.clone());
        }

        #[test]
        fn any_text_is_split_or_refused(text in any::<String>()) {
            let _ = split_arguments(&text);
        }
    }

    #[test]
    fn arguments_are_quoted_where_they_would_be_taken_apart() {
        let arguments = ["-v", "two words", "it's", "", "\\", "\"", "a#b"];
        let text = join_arguments(&arguments);
        assert!(text.starts_with(r"-v 'two words' 'it'\''s' '' "), "{text}");
        assert_eq!(split_arguments(&text).unwrap(), arguments);
    }
}
