//! Writes the SAM C21's flash on behalf of a probe: five functions in RAM, called one at a time with the processor halted
//! in between (Open-CMSIS-Pack, "Flash Programming"). Results: 0 is good.
//!
//! NVMCTRL as the data sheet (DS60001479, "NVMCTRL") describes it: rows of 256 bytes are erased, pages of 64 are filled
//! through the page buffer in 32-bit words and written by command. Not run on silicon yet.
#![no_std]
#![no_main]

const NVMCTRL: usize = 0x4100_4000;
const CTRLA: *mut u16 = NVMCTRL as *mut u16;
const CTRLB: *mut u32 = (NVMCTRL + 0x04) as *mut u32;
const INTFLAG: *const u8 = (NVMCTRL + 0x14) as *const u8;
const STATUS: *mut u16 = (NVMCTRL + 0x18) as *mut u16;
const ADDR: *mut u32 = (NVMCTRL + 0x1c) as *mut u32;

/// Goes with every command.
const KEY: u16 = 0xa500;
const ERASE_ROW: u16 = 0x02;
const WRITE_PAGE: u16 = 0x04;
const CLEAR_PAGE_BUFFER: u16 = 0x44;
/// CTRLB: pages are written by command, not when the buffer is full.
const MANUAL_WRITE: u32 = 1 << 7;
/// STATUS: programming, lock and controller error.
const ERRORS: u16 = 0b1_1100;

const ROW: u32 = 256;
const PAGE: u32 = 64;
const SIZE: u32 = 256 * 1024;

fn command(command: u16, address: u32) -> u32 {
    // SAFETY: the controller lies there, and nothing else runs. It counts in half-words.
    unsafe {
        STATUS.write_volatile(ERRORS);
        ADDR.write_volatile(address / 2);
        CTRLA.write_volatile(KEY | command);
        while INTFLAG.read_volatile() & 1 == 0 {}
        u32::from(STATUS.read_volatile() & ERRORS)
    }
}

/// Gets ready.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".entry.init")]
pub extern "C" fn Init(_address: u32, _clock: u32, _function: u32) -> u32 {
    // SAFETY: as above.
    unsafe { CTRLB.write_volatile(CTRLB.read_volatile() | MANUAL_WRITE) };
    0
}

/// Nothing to tidy up.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".entry.uninit")]
pub extern "C" fn UnInit(_function: u32) -> u32 {
    0
}

/// Erases the row at `address`.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".entry.erase_sector")]
pub extern "C" fn EraseSector(address: u32) -> u32 {
    command(ERASE_ROW, address)
}

/// Erases everything, row by row: the device's own chip erase would end the session.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".entry.erase_chip")]
pub extern "C" fn EraseChip() -> u32 {
    let mut address = 0;
    while address < SIZE {
        let error = command(ERASE_ROW, address);
        if error != 0 {
            return error;
        }
        address += ROW;
    }
    0
}

/// Writes `size` bytes, a multiple of 4, from `data` to `address`, the start of a page.
///
/// # Safety
/// `data` is readable and aligned to 4.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".entry.program_page")]
pub unsafe extern "C" fn ProgramPage(address: u32, size: u32, data: *const u32) -> u32 {
    let mut done = 0;
    while done < size {
        let error = command(CLEAR_PAGE_BUFFER, address + done);
        if error != 0 {
            return error;
        }
        let page = done;
        while done < size && done - page < PAGE {
            // SAFETY: within `data`; writing to the array fills the page buffer.
            unsafe {
                let word = data.add(done as usize / 4).read_volatile();
                ((address + done) as *mut u32).write_volatile(word);
            }
            done += 4;
        }
        let error = command(WRITE_PAGE, address + page);
        if error != 0 {
            return error;
        }
    }
    0
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}
