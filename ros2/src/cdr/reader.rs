//! Reads fields in order from a payload. Bytes and texts are borrowed; nothing is allocated before
//! its count has been compared with the bytes that are left.

use super::{
    Value,
    encapsulation::{ByteOrder, HEADER_BYTES},
    error::{CdrError, CdrFault},
    scalar::Scalar,
};

/// Most bytes after the last field: the padding that CycloneDDS adds
/// (`eclipse-cyclonedds/cyclonedds` issue 1805).
pub const MAX_END_PADDING_BYTES: usize = 3;

/// A position in a payload.
#[derive(Debug, Clone)]
pub struct Reader<'a> {
    body: &'a [u8],
    at: usize,
    order: ByteOrder,
}

impl<'a> Reader<'a> {
    /// Reads the header of `payload` and stands at the first field.
    pub fn new(payload: &'a [u8]) -> Result<Self, CdrError> {
        let order = ByteOrder::of_header(payload)?;
        Ok(Self { body: &payload[HEADER_BYTES..], at: 0, order })
    }

    /// One number.
    pub fn scalar<T: Scalar>(&mut self, field: &str) -> Result<T, CdrError> {
        self.align(T::BYTES);
        let bytes = self.take(T::BYTES, field)?;
        Ok(T::from_bytes(bytes, self.order))
    }

    /// A fixed array of numbers.
    pub fn array<T: Scalar + Default, const N: usize>(&mut self, field: &str) -> Result<[T; N], CdrError> {
        self.align(T::BYTES);
        let bytes = self.take(N * T::BYTES, field)?;
        let mut numbers = [T::default(); N];
        for (number, raw) in numbers.iter_mut().zip(bytes.chunks_exact(T::BYTES)) {
            *number = T::from_bytes(raw, self.order);
        }
        Ok(numbers)
    }

    /// A sequence of numbers.
    pub fn numbers<T: Scalar>(&mut self, field: &str) -> Result<Vec<T>, CdrError> {
        let count = self.count(field, T::BYTES)?;
        if count > 0 {
            self.align(T::BYTES);
        }
        let bytes = self.take(count * T::BYTES, field)?;
        Ok(bytes.chunks_exact(T::BYTES).map(|raw| T::from_bytes(raw, self.order)).collect())
    }

    /// A bool.
    pub fn flag(&mut self, field: &str) -> Result<bool, CdrError> {
        let offset = self.offset();
        match self.scalar::<u8>(field)? {
            0 => Ok(false),
            1 => Ok(true),
            other => Err(CdrError::new(field, offset, CdrFault::NotBool(other))),
        }
    }

    /// A sequence of bytes, borrowed.
    pub fn bytes(&mut self, field: &str) -> Result<&'a [u8], CdrError> {
        let count = self.count(field, 1)?;
        self.take(count, field)
    }

    /// A text, borrowed, without its NUL. A length of 0 is an empty text, as some writers send it.
    pub fn text(&mut self, field: &str) -> Result<&'a str, CdrError> {
        let count = self.count(field, 1)?;
        let offset = self.offset();
        let fault = match self.take(count, field)?.split_last() {
            None => return Ok(""),
            Some((0, text)) => match std::str::from_utf8(text) {
                Ok(text) => return Ok(text),
                Err(_) => CdrFault::NotUtf8,
            },
            Some(_) => CdrFault::Unterminated,
        };
        Err(CdrError::new(field, offset, fault))
    }

    /// A structure.
    pub fn value<T: Value<'a>>(&mut self, field: &str) -> Result<T, CdrError> {
        T::read(self).map_err(|error| error.inside(field))
    }

    /// A sequence of structures.
    pub fn values<T: Value<'a>>(&mut self, field: &str) -> Result<Vec<T>, CdrError> {
        let count = self.count(field, T::MIN_BYTES)?;
        let mut values = Vec::with_capacity(count);
        for i in 0..count {
            values.push(T::read(self).map_err(|error| error.inside(&format!("{field}[{i}]")))?);
        }
        Ok(values)
    }

    /// Nothing but padding follows.
    pub fn finish(self) -> Result<(), CdrError> {
        match self.left() {
            0..=MAX_END_PADDING_BYTES => Ok(()),
            left => Err(CdrError::new("end", self.offset(), CdrFault::Trailing(left))),
        }
    }

    /// The count of a sequence whose elements take at least `min_bytes` each.
    fn count(&mut self, field: &str, min_bytes: usize) -> Result<usize, CdrError> {
        let count: u32 = self.scalar(field)?;
        let left = self.left();
        if u64::from(count) * min_bytes as u64 > left as u64 {
            return Err(CdrError::new(field, self.offset(), CdrFault::Count { count, left }));
        }
        Ok(count as usize)
    }

    fn take(&mut self, needed: usize, field: &str) -> Result<&'a [u8], CdrError> {
        let fault = CdrFault::Truncated { needed, left: self.left() };
        let bytes = self.body.get(self.at..self.at + needed);
        let bytes = bytes.ok_or_else(|| CdrError::new(field, self.offset(), fault))?;
        self.at += needed;
        Ok(bytes)
    }

    /// Passes over padding, at most to the end.
    fn align(&mut self, bytes: usize) {
        self.at = self.at.next_multiple_of(bytes).min(self.body.len());
    }

    fn left(&self) -> usize {
        self.body.len() - self.at
    }

    fn offset(&self) -> usize {
        HEADER_BYTES + self.at
    }
}
