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
    /// What a text says; what it leaves out is everything, as often as it comes. Names of fields are taken in either case.
    pub fn read(text: &str) -> Self {
        let field = |wanted: &str| {
            let mut fields = text.split(',').filter_map(|field| field.split_once('='));
            fields.find(|(name, _)| name.trim().eq_ignore_ascii_case(wanted)).map(|(_, value)| value.trim())
        };
        let pattern = |wanted| field(wanted).filter(|said| !said.is_empty()).unwrap_or("*").to_owned();
        let interval = field("Interval").and_then(|said| said.parse().ok()).unwrap_or(0.0);
        Self { sources: pattern("AppPattern"), keys: pattern("VarPattern"), interval }
    }
}
