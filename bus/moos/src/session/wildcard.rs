//! What a client says when it subscribes to patterns: `AppPattern=..,VarPattern=..,Interval=..`.

/// A subscription to all variables of some names, written by clients of some names.
#[derive(Debug, Clone, PartialEq)]
pub struct Wildcard {
    /// Of the names of clients.
    pub sources: String,
    /// Of the names of variables.
    pub keys: String,
    /// The least time between two messages (s).
    pub interval: f64,
}

impl Wildcard {
    /// What a text says: one of the two patterns at least; what it leaves out beside that is everything, as often as it comes.
    /// Names of fields are taken in either case. An interval is the number that it begins with, as a MOOSDB takes it: of
    /// `0.5s` half a second, and of what begins with none 0, so that a client that says `Interval=fast` hears everything.
    ///
    /// # Errors
    /// It says no pattern; in words that the client is refused with.
    pub fn read(text: &str) -> Result<Self, &'static str> {
        let field = |wanted: &str| {
            let mut fields = text.split(',').filter_map(|field| field.split_once('='));
            fields.find(|(name, _)| name.trim().eq_ignore_ascii_case(wanted)).map(|(_, value)| value.trim())
        };
        let pattern = |wanted| field(wanted).filter(|said| !said.is_empty());
        let (sources, keys) = (pattern("AppPattern"), pattern("VarPattern"));
        if sources.is_none() && keys.is_none() {
            return Err("it says neither AppPattern nor VarPattern; right is AppPattern=*,VarPattern=NAV_*,Interval=0");
        }
        let interval = field("Interval").map_or(0.0, leading_number);
        let or_all = |pattern: Option<&str>| pattern.unwrap_or("*").to_owned();
        Ok(Self { sources: or_all(sources), keys: or_all(keys), interval })
    }
}

/// The decimal number that a text begins with, as C's `atof` has it; 0: it begins with none.
fn leading_number(text: &str) -> f64 {
    let behind_digits = |at: usize| at + text[at..].bytes().take_while(u8::is_ascii_digit).count();
    let behind_sign = |at: usize| at + usize::from(text[at..].starts_with(['+', '-']));
    let mut end = behind_digits(behind_sign(0));
    if text[end..].starts_with('.') {
        end = behind_digits(end + 1);
    }
    if text[end..].starts_with(['e', 'E']) {
        let digits = behind_sign(end + 1);
        let behind = behind_digits(digits);
        end = if behind > digits { behind } else { end };
    }
    text[..end].parse().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_is_the_number_that_it_begins_with() {
        let interval = |said: &str| Wildcard::read(&format!("VarPattern=*,Interval={said}")).unwrap().interval;
        for (said, secs) in [("0.5", 0.5), (" 2 ", 2.0), (".25", 0.25), ("5.", 5.0), ("+1e-1", 0.1), ("-1", -1.0)] {
            assert_eq!(interval(said), secs, "{said}");
        }
        for (said, secs) in [("0.5s", 0.5), ("3e", 3.0), ("2e+x", 2.0), ("1.5.7", 1.5), ("4 ms", 4.0)] {
            assert_eq!(interval(said), secs, "{said}: what follows the number is passed over");
        }
        for said in ["", "fast", "inf", "NaN", "-", ".", "e5", "ä1"] {
            assert_eq!(interval(said), 0.0, "{said}: it begins with no number");
        }
        assert_eq!(Wildcard::read("AppPattern=p*").unwrap().interval, 0.0);
    }
}
