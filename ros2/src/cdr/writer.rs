//! Writes fields in order. Padding is zero, so equal messages have equal bytes.

use super::{
    Value,
    encapsulation::{ByteOrder, HEADER_BYTES},
    scalar::Scalar,
};

/// A message on its way to bytes.
#[derive(Debug)]
pub struct Writer {
    payload: Vec<u8>,
    order: ByteOrder,
}

impl Writer {
    /// Begins with the header.
    pub fn new(order: ByteOrder) -> Self {
        Self { payload: order.header().to_vec(), order }
    }

    /// One number.
    pub fn scalar<T: Scalar>(&mut self, number: T) {
        self.align(T::BYTES);
        number.append(self.order, &mut self.payload);
    }

    /// A fixed array of numbers.
    pub fn array<T: Scalar, const N: usize>(&mut self, numbers: &[T; N]) {
        for number in numbers {
            self.scalar(*number);
        }
    }

    /// A sequence of numbers.
    pub fn numbers<T: Scalar>(&mut self, numbers: &[T]) {
        self.count(numbers.len());
        for number in numbers {
            self.scalar(*number);
        }
    }

    /// A bool.
    pub fn flag(&mut self, flag: bool) {
        self.scalar(u8::from(flag));
    }

    /// A sequence of bytes.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.count(bytes.len());
        self.payload.extend_from_slice(bytes);
    }

    /// A text, with a NUL behind it.
    pub fn text(&mut self, text: &str) {
        self.count(text.len() + 1);
        self.payload.extend_from_slice(text.as_bytes());
        self.payload.push(0);
    }

    /// A sequence of structures.
    pub fn values<'a, T: Value<'a>>(&mut self, values: &[T]) {
        self.count(values.len());
        for value in values {
            value.write(self);
        }
    }

    /// The payload, header included.
    pub fn finish(self) -> Vec<u8> {
        self.payload
    }

    /// Panics beyond what the format can say: 2^32 elements, which no transport here carries.
    fn count(&mut self, count: usize) {
        self.scalar(u32::try_from(count).expect("fewer than 2^32 elements"));
    }

    fn align(&mut self, bytes: usize) {
        let body = (self.payload.len() - HEADER_BYTES).next_multiple_of(bytes);
        self.payload.resize(HEADER_BYTES + body, 0);
    }
}
