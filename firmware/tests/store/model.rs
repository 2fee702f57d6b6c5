//! A flash memory that enforces its rules and loses power when told to.

use sarah_firmware::store::{Flash, FlashFault, PAGE, PAGES, ROW};

/// What an operation leaves behind when power goes in the middle of it.
#[derive(Clone, Copy, Debug)]
pub enum Torn {
    /// Nothing happened yet.
    Before,
    /// Everything happened, but nobody heard of it.
    After,
    /// So many whole bytes, from the start.
    Prefix(usize),
    /// Each bit that was to change did or did not, by a generator with this seed.
    Bits(u64),
}

/// Rows of 256 bytes, pages of 64. Panics on whatever the silicon would not do as asked.
#[derive(Clone)]
pub struct Model {
    pub memory: Vec<u8>,
    written: Vec<bool>,
    /// Polls until an operation ends.
    pub latency: u32,
    pub busy: u32,
    /// Operations started since power-up.
    pub operations: usize,
    /// Power goes during this operation.
    pub cut: Option<(usize, Torn)>,
    /// Off after a cut: nothing changes any more.
    pub powered: bool,
    /// Bits that no longer erase: `(byte, mask)`.
    pub stuck: Option<(usize, u8)>,
    /// The hardware reports an error at these operations.
    pub faults: Vec<usize>,
    pending_fault: bool,
}

impl Model {
    pub fn blank() -> Model {
        Model::holding(vec![0xFF; 8192])
    }

    /// Powered up with this content. What was torn must be erased before it is written.
    pub fn holding(memory: Vec<u8>) -> Model {
        let written = memory.chunks(PAGE).map(|page| page.iter().any(|byte| *byte != 0xFF)).collect();
        let (latency, faults) = (2, Vec::new());
        Model {
            memory,
            written,
            latency,
            busy: 0,
            operations: 0,
            cut: None,
            powered: true,
            stuck: None,
            faults,
            pending_fault: false,
        }
    }

    fn begin(&mut self) -> Option<Torn> {
        assert_eq!(self.busy, 0, "an operation was started before the last one ended");
        self.busy = self.latency;
        let number = self.operations;
        self.operations += 1;
        self.pending_fault = self.faults.contains(&number);
        match self.cut {
            Some((at, torn)) if at == number => {
                self.powered = false;
                Some(torn)
            }
            _ => None,
        }
    }

    fn apply(&mut self, at: usize, target: &[u8], torn: Option<Torn>) {
        let mut random = 0;
        if let Some(Torn::Bits(seed)) = torn {
            random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        }
        for (index, (byte, target)) in self.memory[at..at + target.len()].iter_mut().zip(target).enumerate() {
            let done = match torn {
                None | Some(Torn::After) => 0xFF,
                Some(Torn::Before) => 0,
                Some(Torn::Prefix(bytes)) => 0xFF * u8::from(index < bytes),
                Some(Torn::Bits(_)) => {
                    // xorshift64*
                    random ^= random >> 12;
                    random ^= random << 25;
                    random ^= random >> 27;
                    (random.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 56) as u8
                }
            };
            *byte = (*byte & !done) | (target & done);
        }
        if let Some((byte, mask)) = self.stuck.filter(|(byte, _)| (at..at + target.len()).contains(byte)) {
            self.memory[byte] &= !mask;
        }
    }
}

impl Flash for Model {
    fn read(&self, offset: usize, into: &mut [u8]) {
        assert!(!self.powered || self.busy == 0, "read while an operation is under way");
        for (index, byte) in into.iter_mut().enumerate() {
            *byte = self.memory.get(offset + index).copied().unwrap_or(0xFF);
        }
    }

    fn start_erase(&mut self, row: usize) -> Result<(), FlashFault> {
        if !self.powered {
            return Ok(());
        }
        assert!((row + 1) * ROW <= self.memory.len(), "row {row} is outside");
        let torn = self.begin();
        self.apply(row * ROW, &[0xFF; ROW], torn);
        let whole = matches!(torn, None | Some(Torn::After));
        self.written[row * PAGES..(row + 1) * PAGES].fill(!whole);
        Ok(())
    }

    fn start_write(&mut self, page: usize, data: &[u8; PAGE]) -> Result<(), FlashFault> {
        if !self.powered {
            return Ok(());
        }
        assert!(!self.written[page], "page {page} was written twice without an erasure");
        let torn = self.begin();
        self.written[page] = true;
        // Only clears bits.
        let target: Vec<u8> = self.memory[page * PAGE..].iter().zip(data).map(|(old, new)| old & new).collect();
        self.apply(page * PAGE, &target, torn);
        Ok(())
    }

    fn idle(&mut self) -> Result<bool, FlashFault> {
        if !self.powered {
            return Ok(false);
        }
        if self.busy > 0 {
            self.busy -= 1;
            return Ok(false);
        }
        if std::mem::take(&mut self.pending_fault) { Err(FlashFault) } else { Ok(true) }
    }
}
