//! A place in a value's bytes.

/// What is left of a value.
pub struct Cursor<'a>(pub &'a [u8]);

impl<'a> Cursor<'a> {
    /// The next bytes.
    pub fn take(&mut self, count: u64) -> Result<&'a [u8], String> {
        let there = self.0.len();
        let taken = usize::try_from(count).ok().and_then(|count| self.0.split_at_checked(count));
        let (taken, rest) = taken.ok_or_else(|| format!("{count} bytes are needed, and {there} are left"))?;
        self.0 = rest;
        Ok(taken)
    }

    /// A number of so many bytes.
    pub fn unsigned(&mut self, bytes: u8) -> Result<u64, String> {
        let mut wide = [0; 8];
        wide[..usize::from(bytes)].copy_from_slice(self.take(u64::from(bytes))?);
        Ok(u64::from_le_bytes(wide))
    }

    /// The length of a list or a text.
    pub fn length(&mut self) -> Result<u64, String> {
        self.unsigned(8)
    }
}
