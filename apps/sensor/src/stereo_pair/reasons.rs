//! Why pixels have no disparity, in words.

use std::fmt;

use elk_stereo::{Disparity, Unmatched};

/// Shares of the pixels of an image that have no disparity, by why not.
#[derive(Debug, Clone, PartialEq)]
pub struct Reasons([f64; 5]);

impl Reasons {
    /// Those of a left image.
    pub fn of(disparity: &Disparity) -> Self {
        let all = (disparity.width() * disparity.height()).max(1) as f64;
        Self(Unmatched::ALL.map(|reason| disparity.count(reason) as f64 / all))
    }
}

impl fmt::Display for Reasons {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words =
            ["too little texture", "out of range", "ambiguous", "seen otherwise from the right", "too few neighbours"];
        let said: Vec<String> =
            self.0.iter().zip(words).map(|(share, word)| format!("{word} {:.1} %", share * 100.0)).collect();
        f.write_str(&said.join(", "))
    }
}
