//! Serialised bytes into a buffer, byte by byte: nearly all that a message writes at once is one to three bytes, and for
//! these the chip's copying function takes two hundred cycles.

use core::slice::IterMut;

use postcard::ser_flavors::Flavor;
use postcard::{Error, Result};
use serde::Serialize;

/// Serialises into `buffer`; how many bytes were used, `None` if they did not fit.
pub(crate) fn write<T: Serialize>(value: &T, buffer: &mut [u8]) -> Option<usize> {
    let size = buffer.len();
    let left = postcard::serialize_with_flavor(value, Room(buffer.iter_mut())).ok()?;
    Some(size - left)
}

/// What is left of a buffer.
struct Room<'a>(IterMut<'a, u8>);

impl Flavor for Room<'_> {
    /// Bytes left.
    type Output = usize;

    fn try_push(&mut self, data: u8) -> Result<()> {
        *self.0.next().ok_or(Error::SerializeBufferFull)? = data;
        Ok(())
    }

    fn finalize(self) -> Result<usize> {
        Ok(self.0.len())
    }
}

#[cfg(test)]
mod tests {
    use super::write;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_writes_what_postcard_does_if_there_is_room(
            numbers: (i32, u16, Option<u32>, bool, f32), bytes: [u8; 7], text in ".{0,20}", room in 0_usize..60,
        ) {
            let value = (numbers, bytes, text.as_str());
            let (mut ours, mut theirs) = ([0; 60], [0; 60]);
            let used = write(&value, &mut ours[..room]);
            let expected = postcard::to_slice(&value, &mut theirs[..room]).ok().map(|bytes| bytes.len());
            prop_assert_eq!(used, expected);
            prop_assert_eq!(&ours[..used.unwrap_or(0)], &theirs[..used.unwrap_or(0)]);
        }
    }
}
