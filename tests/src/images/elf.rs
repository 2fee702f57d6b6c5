//! An image: its functions, what each does to the stack, and whom it calls.

use std::collections::{BTreeMap, BTreeSet};

use object::elf::PT_LOAD;
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Object, ObjectSection, ObjectSymbol, SectionKind, SymbolKind};

use super::thumb::{Effect, decode};

/// Where RAM begins; code below it waits for the flash.
pub const RAM: u32 = 0x2000_0000;

/// One function.
#[derive(Clone, Debug, Default)]
pub struct Function {
    /// Demangled.
    pub name: String,
    /// Bytes of stack of its own, at most.
    pub frame: u32,
    /// Addresses of the functions it calls or ends in.
    pub calls: BTreeSet<u32>,
    /// Whether it calls through a pointer.
    pub indirect: bool,
}

/// A linked image.
#[derive(Clone, Debug, Default)]
pub struct Image {
    /// By address.
    pub functions: BTreeMap<u32, Function>,
    /// Functions whose address lies in data or in a literal pool: what a pointer may point to.
    pub pointed_at: BTreeSet<u32>,
    /// The vector table: initial stack pointer, then handlers.
    pub vectors: Vec<u32>,
    /// Bytes that are flashed.
    pub flash: u32,
    /// Bytes of RAM that are taken from the start.
    pub ram: u32,
    /// Every symbol, demangled.
    pub symbols: BTreeSet<String>,
}

impl Image {
    /// Reads an ELF file.
    pub fn read(bytes: &[u8]) -> Result<Image, String> {
        let file = object::File::parse(bytes).map_err(|error| error.to_string())?;
        let mut image = Image::default();
        (image.flash, image.ram) = sizes(bytes)?;
        let word = |bytes: &[u8]| bytes.try_into().map(u32::from_le_bytes).unwrap_or_default();
        let table = file.section_by_name(".vector_table").ok_or("no vector table: not one of our images")?;
        image.vectors = table.data().map_err(|error| error.to_string())?.chunks(4).map(word).collect();

        // Several symbols may name one function; the first stays. Hand-written ones have no size: up to the next.
        let mut sizes: BTreeMap<u32, u32> = BTreeMap::new();
        for symbol in file.symbols() {
            let name = symbol.name().unwrap_or_default();
            let name = format!("{:#}", rustc_demangle::demangle(name));
            let code = symbol.section_index().and_then(|index| file.section_by_index(index).ok());
            let is_code = code.is_some_and(|section| section.kind() == SectionKind::Text);
            if is_code && symbol.kind() != SymbolKind::Section && !name.starts_with('$') {
                let start = symbol.address() as u32 & !1;
                let size = sizes.entry(start).or_default();
                *size = (*size).max(symbol.size() as u32);
                image.functions.entry(start).or_insert(Function { name: name.clone(), ..Function::default() });
            }
            image.symbols.insert(name);
        }
        let starts: Vec<u32> = sizes.keys().copied().collect();
        for pair in starts.windows(2) {
            sizes.entry(pair[0]).and_modify(|size| *size = if *size == 0 { pair[1] - pair[0] } else { *size });
        }

        let marks: BTreeMap<u32, bool> = file
            .symbols()
            .filter_map(|symbol| {
                let name = symbol.name().ok()?;
                let is = |mark: &str| name == mark || name.starts_with(&format!("{mark}."));
                (is("$d") || is("$t")).then_some((symbol.address() as u32 & !1, is("$t")))
            })
            .collect();
        for section in file.sections() {
            let base = section.address() as u32;
            let data = section.data().unwrap_or_default();
            match section.kind() {
                _ if section.name() == Ok(".vector_table") => continue,
                SectionKind::Text => {}
                SectionKind::Data | SectionKind::ReadOnlyData | SectionKind::ReadOnlyString => {
                    image.pointers(data);
                    continue;
                }
                _ => continue,
            }
            let inside: Vec<(u32, u32)> =
                sizes.range(base..base + data.len() as u32).map(|(start, size)| (*start, *size)).collect();
            for (start, size) in inside {
                let at = (start - base) as usize;
                let code = data.get(at..at + size as usize).ok_or("a function reaches beyond its section")?;
                image.function(start, code, &marks);
            }
        }
        Ok(image)
    }

    /// Functions that words of `data` point at.
    fn pointers(&mut self, data: &[u8]) {
        for word in data.as_chunks::<4>().0 {
            let value = u32::from_le_bytes(*word);
            if value & 1 == 1 && self.functions.contains_key(&(value & !1)) {
                self.pointed_at.insert(value & !1);
            }
        }
    }

    fn function(&mut self, start: u32, code: &[u8], marks: &BTreeMap<u32, bool>) {
        let mut found = Function::default();
        let bridge = is_bridge(self.name(start));
        let mut registers: [Option<u32>; 16] = [None; 16];
        let word = |address: u32| {
            let at = address.checked_sub(start)? as usize;
            code.get(at..at + 4)?.try_into().map(u32::from_le_bytes).ok()
        };
        let mut at = 0;
        while at < code.len() {
            let address = start + at as u32;
            let is_code = marks.range(..=address).next_back().is_none_or(|(_, code)| *code);
            if !is_code {
                // A literal pool or a jump table.
                match word(address) {
                    Some(target) if bridge => _ = found.calls.insert(target & !1),
                    _ => self.pointers(code.get(at..at + 4).unwrap_or_default()),
                }
                at += if bridge { 4 } else { 2 };
                continue;
            }
            let (effect, length) = decode(address, &code[at..]);
            match effect {
                Effect::Push(bytes) => found.frame += bytes,
                Effect::Literal(register, from) => registers[usize::from(register)] = word(from),
                Effect::AddSp(register) => {
                    let change = registers[usize::from(register)].map_or(0, |value| value as i32);
                    found.frame += change.min(0).unsigned_abs();
                }
                // A jump too far for a plain one is made by BL.
                Effect::Call(target) if !(start + 1..start + code.len() as u32).contains(&target) => {
                    found.calls.insert(target);
                }
                Effect::Jump(target) if !(start..start + code.len() as u32).contains(&target) => {
                    found.calls.insert(target);
                }
                Effect::Indirect => found.indirect = true,
                Effect::Call(_) | Effect::Jump(_) | Effect::Other => {}
            }
            at += length as usize;
        }
        if let Some(function) = self.functions.get_mut(&start) {
            *function = Function { name: std::mem::take(&mut function.name), ..found };
        }
    }

    /// Functions whose name ends in `::suffix`, without generic arguments and hashes.
    pub fn named<'a>(&'a self, suffix: &'a str) -> impl Iterator<Item = u32> + 'a {
        let matches = move |name: &str| name == suffix || name.ends_with(&format!("::{suffix}"));
        self.functions.iter().filter(move |(_, function)| matches(&function.name)).map(|(address, _)| *address)
    }

    /// The name of the function at `address`.
    pub fn name(&self, address: u32) -> &str {
        self.functions.get(&address).map_or("?", |function| &function.name)
    }
}

/// Whether a function is the linker's: it does nothing but jump where the word behind it says, for flash and RAM are too
/// far apart for a plain call.
pub fn is_bridge(name: &str) -> bool {
    name.starts_with("__Thumb") && name.contains("Thunk_")
}

/// Flash and static RAM.
fn sizes(bytes: &[u8]) -> Result<(u32, u32), String> {
    let header = object::elf::FileHeader32::<object::LittleEndian>::parse(bytes).map_err(|error| error.to_string())?;
    let endian = object::LittleEndian;
    let (mut flash, mut ram) = (0, 0);
    for segment in header.program_headers(endian, bytes).map_err(|error| error.to_string())? {
        if segment.p_type(endian) == PT_LOAD {
            flash += segment.p_filesz(endian);
            // Initial values lie in flash and are copied to RAM.
            ram += if segment.p_vaddr(endian) >= RAM { segment.p_memsz(endian) } else { 0 };
        }
    }
    Ok((flash, ram))
}
