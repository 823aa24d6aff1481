//! Numbers out of the bytes of a file, little-endian, one after another. Nothing is believed of how many there are to come.

/// Bytes that are read from front to back.
#[derive(Debug, Clone, PartialEq)]
pub struct Bytes<'a> {
    rest: &'a [u8],
    /// Where `rest` begins in the file.
    at: usize,
}

/// The file ends where there should be more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CutOff {
    /// The file's length.
    pub end: usize,
}

impl<'a> Bytes<'a> {
    /// Bytes that begin at byte `at` of their file.
    pub fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { rest: bytes, at }
    }

    /// Where the next byte stands in the file.
    pub fn at(&self) -> usize {
        self.at
    }

    /// Bytes that are left.
    pub fn left(&self) -> usize {
        self.rest.len()
    }

    /// The next `N` bytes.
    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], CutOff> {
        let (array, rest) = self.rest.split_first_chunk().ok_or(CutOff { end: self.at + self.rest.len() })?;
        (self.rest, self.at) = (rest, self.at + N);
        Ok(*array)
    }

    /// Passes over `count` bytes.
    pub fn skip(&mut self, count: usize) -> Result<(), CutOff> {
        self.rest = self.rest.get(count..).ok_or(CutOff { end: self.at + self.rest.len() })?;
        self.at += count;
        Ok(())
    }

    pub fn u8(&mut self) -> Result<u8, CutOff> {
        self.array::<1>().map(|[byte]| byte)
    }

    pub fn i16(&mut self) -> Result<i16, CutOff> {
        self.array().map(i16::from_le_bytes)
    }

    pub fn u16(&mut self) -> Result<u16, CutOff> {
        self.array().map(u16::from_le_bytes)
    }

    pub fn u32(&mut self) -> Result<u32, CutOff> {
        self.array().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Result<u64, CutOff> {
        self.array().map(u64::from_le_bytes)
    }

    pub fn f32(&mut self) -> Result<f32, CutOff> {
        self.array().map(f32::from_le_bytes)
    }

    pub fn f64(&mut self) -> Result<f64, CutOff> {
        self.array().map(f64::from_le_bytes)
    }
}
