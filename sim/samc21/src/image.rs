//! Firmware images: what of an ELF goes into flash, its functions and its variables.

use object::elf;
use object::read::elf::{FileHeader, ProgramHeader, Sym};
use thiserror::Error;

use crate::nvm::Nvm;
use crate::symbols::{Symbol, Symbols};

/// Why an ELF is not a firmware image.
#[derive(Debug, Error)]
pub enum ImageError {
    /// The file cannot be read as an ELF.
    #[error("not a readable ELF file: {0}")]
    Malformed(#[from] object::read::Error),
    /// A segment reaches beyond the end of the file.
    #[error("the file ends within a segment")]
    Truncated,
    /// An ELF, but for another processor.
    #[error("built for ELF machine {0}, not for ARM (40)")]
    Machine(u16),
    /// A segment lies where there is no non-volatile memory.
    #[error("{length} bytes at {address:#010x} are outside flash, RWWEE and user row")]
    Outside {
        /// Load address.
        address: u32,
        /// Bytes.
        length: usize,
    },
    /// Nothing to flash.
    #[error("no loadable segment")]
    Empty,
}

/// An image: the bytes to flash, the names of functions and variables.
#[derive(Clone, Debug, Default)]
pub struct Image {
    /// Address and contents of each loadable segment.
    pub segments: Vec<(u32, Vec<u8>)>,
    /// Functions.
    pub symbols: Symbols,
    /// Variables.
    pub variables: Symbols,
}

impl Image {
    /// Reads a 32-bit little-endian ARM ELF.
    pub fn from_elf(bytes: &[u8]) -> Result<Self, ImageError> {
        let header = elf::FileHeader32::<object::Endianness>::parse(bytes)?;
        let endian = header.endian()?;
        let machine = header.e_machine(endian);
        if machine.0 != elf::EM_ARM.0 {
            return Err(ImageError::Machine(machine.0));
        }
        let mut segments = vec![];
        for segment in header.program_headers(endian, bytes)? {
            if segment.p_type(endian) != elf::PT_LOAD {
                continue;
            }
            let data = segment.data(endian, bytes).map_err(|()| ImageError::Truncated)?;
            let address = segment.p_paddr(endian);
            if data.is_empty() {
                continue;
            }
            let last = address.wrapping_add(data.len() as u32 - 1);
            if !Nvm::contains(address) || !Nvm::contains(last) {
                return Err(ImageError::Outside { address, length: data.len() });
            }
            segments.push((address, data.to_vec()));
        }
        if segments.is_empty() {
            return Err(ImageError::Empty);
        }
        let sections = header.sections(endian, bytes)?;
        let table = sections.symbols(endian, bytes, elf::SHT_SYMTAB)?;
        let named = |kind| {
            let named = table.iter().filter(|symbol| symbol.st_type() == kind).filter_map(|symbol| {
                let name = String::from_utf8_lossy(symbol.name(endian, table.strings()).ok()?).into_owned();
                // Without the hash that tells two compilations apart.
                let name = format!("{:#}", rustc_demangle::demangle(&name));
                Some(Symbol { address: symbol.st_value(endian) & !1, size: symbol.st_size(endian), name })
            });
            Symbols::new(named.collect())
        };
        Ok(Image { segments, symbols: named(elf::STT_FUNC), variables: named(elf::STT_OBJECT) })
    }

    /// An image without symbols, of `code` at address 0.
    pub fn from_binary(code: &[u8]) -> Self {
        Image { segments: vec![(0, code.to_vec())], ..Image::default() }
    }
}
