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
    /// Names of fields are taken in either case.
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
        let interval = field("Interval").and_then(|said| said.parse().ok()).unwrap_or(0.0);
        let or_all = |pattern: Option<&str>| pattern.unwrap_or("*").to_owned();
        Ok(Self { sources: or_all(sources), keys: or_all(keys), interval })
    }
}
