//! A whole session as bytes, and back, bit for bit: weights, targets, Adam, replay, generators, noise, counters.
//!
//! ```text
//! "eNAF" | version u16 LE | postcard(Trainer)
//! ```

use super::{EnafConfig, EnafError, Trainer};

const MAGIC: [u8; 4] = *b"eNAF";
/// Raised whenever anything inside [`Trainer`] changes its layout.
const VERSION: u16 = 1;

impl Trainer {
    /// The session as bytes. A session loaded from them goes on exactly as this one would.
    ///
    /// # Errors
    /// [`EnafError::Codec`] if encoding fails.
    pub fn save(&self) -> Result<Vec<u8>, EnafError> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        Ok(postcard::to_extend(self, bytes)?)
    }

    /// The session saved as `bytes`. `config` must be the one it was started with.
    ///
    /// # Errors
    /// Bytes that are no checkpoint, of another version, cut short, or of another configuration.
    pub fn load(config: &EnafConfig, bytes: &[u8]) -> Result<Self, EnafError> {
        let body = bytes.strip_prefix(&MAGIC).ok_or(EnafError::NotACheckpoint)?;
        let (version, body) = body.split_first_chunk().ok_or(EnafError::NotACheckpoint)?;
        let found = u16::from_le_bytes(*version);
        if found != VERSION {
            return Err(EnafError::CheckpointVersion { found, expected: VERSION });
        }
        let trainer: Self = postcard::from_bytes(body)?;
        if trainer.config != config.resolved() {
            return Err(EnafError::CheckpointMismatch("the session"));
        }
        Ok(trainer)
    }
}
