//! What instructions and exceptions cost, in CPU cycles (Cortex-M0+ TRM, "Instruction set summary", with the fast
//! multiplier).
//!
//! An instruction costs a base, and each memory access that it makes costs [`ACCESS`] more, except on the single-cycle
//! I/O bus: so LDR is 2 or 1, LDM and POP 1+N, POP with PC 3+N. The memory adds what it needs on top: flash wait states
//! ([`Nvm`](crate::nvm::Nvm)), bus bridges, stalls.
//!
//! Not modelled: an interrupt abandons a load or store multiple on silicon and restarts it; here it waits for it.

/// One access on the AHB bus.
pub const ACCESS: u64 = 1;
/// Most instructions.
pub const SIMPLE: u64 = 1;
/// A branch that is taken, by B, BX, BLX, and writes to PC by ADD and MOV.
pub const BRANCH: u64 = 2;
/// BL.
pub const BRANCH_LINK: u64 = 3;
/// POP with PC, before its accesses.
pub const POP_PC: u64 = 3;
/// MRS, MSR, DMB, DSB, ISB.
pub const SYSTEM: u64 = 3;
/// WFI, WFE.
pub const SLEEP: u64 = 2;
/// From the end of the interrupted instruction to the first one of the handler, at zero wait states (TRM, "Exception
/// handling": 15).
pub const ENTRY: u64 = 15;
/// An exception return beyond the BX or POP that makes it. Assumption: eight loads, and three cycles around them; the
/// TRM gives no figure.
pub const RETURN: u64 = 11;
/// From one handler to the next without unstacking. Assumption: the figure ARM publishes for Cortex-M3; the TRM of the
/// Cortex-M0+ says only that it tail-chains.
pub const TAIL_CHAIN: u64 = 6;
