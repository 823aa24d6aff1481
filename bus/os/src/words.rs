//! What processes say to people.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::fmt::Display;
use std::io::Write;

use elk_outside::text::printable_lines;

/// Says something to people: a line on standard error. Where that goes to a disk that is full, or to a reader that has
/// gone, the words are lost; nobody ends over it, as with [`eprintln!`].
pub fn tell(words: impl Display) {
    let Some(words) = Overheard::take(words) else { return };
    // One write, so that the lines of several processes do not mix; and what others have made up rules no terminal.
    let line = format!("{}\n", printable_lines(&words.to_string()));
    let _ = std::io::stderr().write_all(line.as_bytes());
}

thread_local! {
    /// Who listens to what this thread says, and how many lines it keeps.
    static LISTENER: RefCell<Option<(usize, VecDeque<String>)>> = const { RefCell::new(None) };
}

/// As long as it lives, what its thread tells people ([`tell`]) is kept here and not said: of many missions in one process
/// each has its own words. A thread has one listener; a second one takes the first one's place.
#[derive(Debug)]
pub struct Overheard(());

impl Overheard {
    /// Listens from now on, and keeps the last `most` lines.
    pub fn listen(most: usize) -> Self {
        LISTENER.set(Some((most, VecDeque::new())));
        Self(())
    }

    /// What was said last, the oldest first.
    pub fn words(&self) -> Vec<String> {
        LISTENER.with_borrow(|listener| listener.iter().flat_map(|(_, lines)| lines.iter().cloned()).collect())
    }

    /// Keeps words if anybody listens; answers them if not.
    fn take<T: Display>(words: T) -> Option<T> {
        LISTENER.with_borrow_mut(|listener| {
            let Some((most, lines)) = listener else { return Some(words) };
            lines.push_back(words.to_string());
            while lines.len() > *most {
                lines.pop_front();
            }
            None
        })
    }
}

impl Drop for Overheard {
    fn drop(&mut self) {
        LISTENER.set(None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_listens_hears_its_own_thread_and_keeps_the_last_words() {
        let overheard = Overheard::listen(2);
        for word in ["one", "two", "three"] {
            tell(word);
        }
        std::thread::spawn(|| tell("(said by a test)")).join().unwrap();
        assert_eq!(overheard.words(), ["two", "three"]);
        drop(overheard);
        assert_eq!(Overheard::take("four"), Some("four"), "it is said again");
    }
}
