//! One writer at a time.

use sarah_protocol::host::Refusal;

use super::age::Age;

/// Who may write, and for how long the robot has not heard of a writer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Writer {
    owner: Option<u16>,
    silence: Age,
}

impl Writer {
    /// Nobody yet, and nobody ever heard.
    pub const fn new() -> Self {
        Writer { owner: None, silence: Age::NEVER }
    }

    /// `dt_us` passed. True if the writer lapsed with it.
    pub fn advance(&mut self, dt_us: u32, lapse_us: u32) -> bool {
        self.silence.advance(dt_us);
        let lapsed = self.owner.is_some() && self.silence.reached(lapse_us);
        if lapsed {
            self.owner = None;
        }
        lapsed
    }

    /// A frame of `session` arrived.
    pub fn heard(&mut self, session: u16) {
        if self.owner == Some(session) {
            self.silence.reset();
        }
    }

    /// Makes `session` the writer unless another one is alive.
    pub fn claim(&mut self, session: u16) -> Result<(), Refusal> {
        match self.owner {
            _ if session == 0 => Err(Refusal::OutOfRange),
            Some(by) if by != session => Err(Refusal::Claimed { by }),
            _ => {
                self.owner = Some(session);
                self.silence.reset();
                Ok(())
            }
        }
    }

    /// Gives the claim up.
    pub fn release(&mut self, session: u16) -> Result<(), Refusal> {
        self.check(session)?;
        self.owner = None;
        Ok(())
    }

    /// Refuses everyone but the writer.
    pub fn check(&self, session: u16) -> Result<(), Refusal> {
        match self.owner {
            Some(owner) if owner == session => Ok(()),
            Some(by) => Err(Refusal::Claimed { by }),
            None => Err(Refusal::NotClaimed),
        }
    }

    /// Time since any writer was heard.
    pub const fn silence(&self) -> Age {
        self.silence
    }
}
