//! Function names of an image, to say where something happened.

use std::sync::Arc;

/// A function of the image.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Symbol {
    /// First address, without the Thumb bit.
    pub address: u32,
    /// Bytes it occupies, zero if the image does not say.
    pub size: u32,
    /// Demangled as far as the image's linker left it; taken verbatim.
    pub name: String,
}

/// The functions of an image, by address. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Symbols(Arc<[Symbol]>);

impl Symbols {
    /// From functions in any order; of several at one address the first by name is kept.
    pub fn new(mut symbols: Vec<Symbol>) -> Self {
        symbols.sort_by(|a, b| a.address.cmp(&b.address).then_with(|| a.name.cmp(&b.name)));
        symbols.dedup_by_key(|symbol| symbol.address);
        Symbols(symbols.into())
    }

    /// All functions, by address.
    pub fn all(&self) -> &[Symbol] {
        &self.0
    }

    /// Index into [`Self::all`] of the function around `address`.
    pub fn index(&self, address: u32) -> Option<usize> {
        let index = self.0.partition_point(|symbol| symbol.address <= address).checked_sub(1)?;
        let symbol = &self.0[index];
        (symbol.size == 0 || address < symbol.address + symbol.size).then_some(index)
    }

    /// `name+0x12` for the function around `address`.
    pub fn describe(&self, address: u32) -> Option<String> {
        let symbol = &self.0[self.index(address)?];
        Some(match address - symbol.address {
            0 => symbol.name.clone(),
            offset => format!("{}+{offset:#x}", symbol.name),
        })
    }

    /// Address of the function called `name`.
    pub fn address(&self, name: &str) -> Option<u32> {
        self.0.iter().find(|symbol| symbol.name == name).map(|symbol| symbol.address)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn symbols() -> Symbols {
        Symbols::new(vec![
            Symbol { address: 0x200, size: 0x10, name: "tick".into() },
            Symbol { address: 0x100, size: 0, name: "Reset".into() },
        ])
    }

    #[test]
    fn an_address_is_named_by_the_function_around_it() {
        assert_eq!(symbols().describe(0x200).as_deref(), Some("tick"));
        assert_eq!(symbols().describe(0x20e).as_deref(), Some("tick+0xe"));
        assert_eq!(symbols().describe(0x180).as_deref(), Some("Reset+0x80"));
    }

    #[test]
    fn an_address_outside_every_function_has_no_name() {
        assert_eq!(symbols().describe(0x210), None);
        assert_eq!(symbols().describe(0x80), None);
    }
}
