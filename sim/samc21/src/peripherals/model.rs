//! What every peripheral model can do.

use crate::context::Context;
use crate::reset::Reset;
use crate::time::Cycles;
use crate::width::Width;

/// The behaviour of one peripheral.
///
/// `offset` is relative to the unit's base. Time passes only through [`Context::now`]; a model that acts later says so
/// in [`Model::next_event`] and is then called by [`Model::advance`].
pub trait Model {
    /// A read of `width` at `offset`, aligned to `width`. Unused high bits of the result are ignored.
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32;

    /// A write of `width` at `offset`, aligned to `width`. `value` has no bits beyond `width`.
    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context);

    /// When the model next acts by itself; asked after every other call. In the past means at once.
    fn next_event(&self) -> Option<Cycles> {
        None
    }

    /// [`Model::next_event`] has come: `ctx.now` is at or after it. Must move its next event into the future.
    fn advance(&mut self, _ctx: &mut Context) {}

    /// Whether [`Model::notice`] does anything.
    const NOTICES: bool = false;

    /// The outside has changed [`Context::wires`], or a clock model has changed [`Context::clocks`].
    fn notice(&mut self, _ctx: &mut Context) {}

    /// Any reset of the chip but a power-on: by default everything starts over. `self` is then as constructed.
    fn reset(&mut self, _cause: Reset, _ctx: &mut Context)
    where
        Self: Default,
    {
        *self = Self::default();
    }
}

/// Whether a model wants to know that wires or clocks have changed.
pub(super) const fn notices<M: Model>(_: &M) -> bool {
    M::NOTICES
}
