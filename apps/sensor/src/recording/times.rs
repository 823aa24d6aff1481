//! Times of frames, which go forwards.

/// The times of the frames so far.
#[derive(Debug)]
pub(crate) struct Times {
    /// Of the last frame but one, and of the last one (s).
    last: [f64; 2],
}

impl Times {
    /// Before the first frame.
    pub fn new() -> Self {
        Self { last: [f64::NEG_INFINITY; 2] }
    }

    /// Takes the next frame's (s).
    ///
    /// # Errors
    /// It is from before the last one. Where it is behind the one before that, the last one said a time that was none: times go on from this one.
    pub fn next(&mut self, secs: f64) -> Result<(), String> {
        let [before, last] = self.last;
        if secs >= last {
            self.last = [last, secs];
            return Ok(());
        }
        self.last[1] = if secs >= before { secs } else { last };
        Err(format!("a time of {secs} s after one of {last} s"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Regression: all frames behind one whose clock was ahead were passed over.
    #[test]
    fn one_time_that_is_none_costs_one_frame_more() {
        let mut times = Times::new();
        let taken = [1.0, 2.0, 1e9, 3.0, 0.5, 4.0, 4.0].map(|secs| times.next(secs));
        assert_eq!(taken.each_ref().map(Result::is_ok), [true, true, true, false, false, true, true]);
        assert_eq!(taken[4], Err("a time of 0.5 s after one of 3 s".to_owned()));
    }
}
