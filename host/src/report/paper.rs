//! Table II of the paper, to stand beside ours.

/// One parameter of Table II.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableIIEntry {
    /// The parameter.
    pub symbol: &'static str,
    /// Its final value, in the paper's unit, which the paper does not give.
    pub value: f64,
    /// The spread printed with it.
    pub spread: f64,
}

const fn entry(symbol: &'static str, value: f64, spread: f64) -> TableIIEntry {
    TableIIEntry { symbol, value, spread }
}

/// Table II, "Pattern Generators Final Parameters".
pub const TABLE_II: [TableIIEntry; 13] = [
    entry("P1", 1.81, 0.05),
    entry("P2", 1.45, 0.05),
    entry("P3", 2.09, 0.05),
    entry("H1", 0.05, 0.01),
    entry("H2", 1.13, 0.03),
    entry("H3", 2.31, 0.03),
    entry("H4", 1.72, 0.05),
    entry("H5", 1.51, 0.05),
    entry("V1", 0.07, 0.01),
    entry("V2", 1.06, 0.03),
    entry("V3", 2.54, 0.03),
    entry("V4", 1.85, 0.05),
    entry("V5", 2.77, 0.05),
];
