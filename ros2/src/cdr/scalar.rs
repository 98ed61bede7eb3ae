//! Numbers of fixed size in both byte orders.

use super::encapsulation::ByteOrder;

/// A number that is aligned to its size.
pub trait Scalar: Copy {
    /// Its size and alignment, bytes.
    const BYTES: usize;

    /// From exactly [`Scalar::BYTES`] bytes.
    fn from_bytes(bytes: &[u8], order: ByteOrder) -> Self;

    /// Appends its bytes.
    fn append(self, order: ByteOrder, out: &mut Vec<u8>);
}

macro_rules! scalar {
    ($($number:ty),*) => {$(
        impl Scalar for $number {
            const BYTES: usize = size_of::<$number>();

            fn from_bytes(bytes: &[u8], order: ByteOrder) -> Self {
                let mut raw = [0; size_of::<$number>()];
                raw.copy_from_slice(bytes);
                match order {
                    ByteOrder::Big => Self::from_be_bytes(raw),
                    ByteOrder::Little => Self::from_le_bytes(raw),
                }
            }

            fn append(self, order: ByteOrder, out: &mut Vec<u8>) {
                match order {
                    ByteOrder::Big => out.extend(self.to_be_bytes()),
                    ByteOrder::Little => out.extend(self.to_le_bytes()),
                }
            }
        }
    )*};
}

scalar!(u8, i32, u32, f32, f64);
