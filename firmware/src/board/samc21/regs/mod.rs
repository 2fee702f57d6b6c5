//! The chip's registers, typed: offsets by `#[repr(C)]`, fields by position, names as in the data sheet (DS60001479).
//!
//! No address is touched by declaring them, so they compile anywhere, and a host test compares every one of them with
//! `facts.toml`. To add a peripheral: a file with its block (`derive_mmio::Mmio`) and its registers (`bitbybit`, with
//! `debug`), its base address in [`BASES`], and at the end `agrees_with_facts!`, which names every member of the block
//! with its type, then the reserved ones; a member left out does not compile. Offsets, sizes, bit positions, widths and
//! the names of enumerated values are then checked; fields of the facts that nobody needs may be left out.

// The names are the data sheet's and mean what it says.
#![allow(missing_docs)]

/// The test of one block; see above.
macro_rules! agrees_with_facts {
    ($test:ident: $block:ident is $facts:literal { $($register:ident: $kind:tt),* $(,)? } $($reserved:ident)*) => {
        #[cfg(test)]
        #[test]
        fn $test() {
            #[allow(dead_code)]
            fn names_every_member($block { $($register: _,)* $($reserved: _,)* }: $block) {}
            $({
                let (count, show): (usize, crate::board::samc21::regs::facts::Show) = agrees_with_facts!(@shape $kind);
                let bytes = crate::board::samc21::regs::facts::bytes(|block: &$block| &block.$register);
                let offset = core::mem::offset_of!($block, $register);
                let name = stringify!($register);
                crate::board::samc21::regs::facts::check($facts, name, offset, bytes / count, count, show);
            })*
        }
    };
    (@shape [$kind:tt; $count:literal]) => { ($count, agrees_with_facts!(@show $kind)) };
    (@shape $kind:tt) => { (1, agrees_with_facts!(@show $kind)) };
    (@show u8) => { None };
    (@show u16) => { None };
    (@show u32) => { None };
    (@show $kind:ident) => { Some(|raw: u32| format!("{:#?}", <$kind>::new_with_raw_value(raw as _))) };
}

#[cfg(test)]
pub mod facts;

pub mod adc;
pub mod clock;
pub mod divas;
pub mod dmac;
pub mod nvmctrl;
pub mod port;
pub mod sercom;
pub mod system;
pub mod tc;
pub mod tcc;

/// Where each instance lies.
pub const BASES: &[(&str, usize)] = &[
    ("ADC0", adc::ADC0),
    ("DIVAS_IOBUS", divas::DIVAS_IOBUS),
    ("DMAC", dmac::DMAC),
    ("GCLK", clock::GCLK),
    ("MCLK", clock::MCLK),
    ("NVMCTRL", nvmctrl::NVMCTRL),
    ("OSC32KCTRL", clock::OSC32KCTRL),
    ("OSCCTRL", clock::OSCCTRL),
    ("PORT", port::PORT),
    ("PORT_IOBUS", port::PORT_IOBUS),
    ("RSTC", system::RSTC),
    ("SERCOM1", sercom::SERCOM1),
    ("SERCOM4", sercom::SERCOM4),
    ("TC0", tc::TC0),
    ("TC2", tc::TC2),
    ("TC4", tc::TC4),
    ("TCC0", tcc::TCC0),
    ("WDT", system::WDT),
];

#[cfg(test)]
#[test]
fn every_base_address_is_the_facts() {
    for (name, base) in BASES {
        assert_eq!(facts::number("bases", name), *base as i64, "{name}");
    }
}
