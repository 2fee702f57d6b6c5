//! The log: defmt frames in RAM where a probe finds them (SEGGER's RTT layout).
//!
//! Tasks in thread mode log, and only they: a frame begun by an interrupt is dropped. So nothing is masked while a frame
//! is encoded, and the control tick never waits for a log. A full buffer drops what does not fit: without a probe the
//! log costs time but never stops anything.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering, compiler_fence};

use cortex_m::peripheral::SCB;
use cortex_m::peripheral::scb::VectActive;

const BYTES: usize = 512;

/// What a probe looks for in RAM: the name, counts, one channel up, none down.
#[repr(C)]
struct ControlBlock {
    /// `SEGGER RTT`, padded; complete in RAM only, so that no copy in flash is found first.
    id: UnsafeCell<[u8; 16]>,
    up_channels: i32,
    down_channels: i32,
    name: *const u8,
    buffer: *mut u8,
    size: u32,
    /// Next byte the chip writes.
    write: AtomicU32,
    /// Next byte the probe reads; the probe writes it.
    read: AtomicU32,
    /// 0: drop what does not fit.
    flags: AtomicU32,
}

// SAFETY: written by thread mode alone; what the probe writes is atomic.
unsafe impl Sync for ControlBlock {}

struct Buffer(UnsafeCell<[u8; BYTES]>);
// SAFETY: as above.
unsafe impl Sync for Buffer {}

static BUFFER: Buffer = Buffer(UnsafeCell::new([0; BYTES]));

#[unsafe(no_mangle)]
static _SEGGER_RTT: ControlBlock = ControlBlock {
    id: UnsafeCell::new([0; 16]),
    up_channels: 1,
    down_channels: 0,
    name: c"defmt".as_ptr().cast(),
    buffer: BUFFER.0.get().cast(),
    size: BYTES as u32,
    write: AtomicU32::new(0),
    read: AtomicU32::new(0),
    flags: AtomicU32::new(0),
};

/// Makes the log visible to a probe.
pub fn start() {
    let id: [u8; 16] = core::array::from_fn(|i| b"TTR REGGES".get(9_usize.wrapping_sub(i)).copied().unwrap_or(0));
    // SAFETY: thread mode, before anything is logged.
    unsafe { _SEGGER_RTT.id.get().write_volatile(id) };
}

fn put(bytes: &[u8]) {
    let mut write = _SEGGER_RTT.write.load(Ordering::Relaxed) as usize % BYTES;
    for byte in bytes {
        let next = (write + 1) % BYTES;
        if next == _SEGGER_RTT.read.load(Ordering::Relaxed) as usize {
            break;
        }
        // SAFETY: below BYTES; only thread mode writes, and the probe does not read past `write`.
        unsafe { BUFFER.0.get().cast::<u8>().add(write).write_volatile(*byte) };
        write = next;
    }
    compiler_fence(Ordering::Release);
    _SEGGER_RTT.write.store(write as u32, Ordering::Release);
}

fn in_thread_mode() -> bool {
    matches!(SCB::vect_active(), VectActive::ThreadMode)
}

struct Encoder(UnsafeCell<defmt::Encoder>);
// SAFETY: used in thread mode only, and no frame begins within another.
unsafe impl Sync for Encoder {}
static ENCODER: Encoder = Encoder(UnsafeCell::new(defmt::Encoder::new()));

#[defmt::global_logger]
struct Log;

// SAFETY: frames come from thread mode alone, one after the other; other frames are dropped whole.
unsafe impl defmt::Logger for Log {
    fn acquire() {
        if in_thread_mode() {
            // SAFETY: see `Encoder`.
            unsafe { (*ENCODER.0.get()).start_frame(put) }
        }
    }

    unsafe fn flush() {}

    unsafe fn release() {
        if in_thread_mode() {
            // SAFETY: see `Encoder`.
            unsafe { (*ENCODER.0.get()).end_frame(put) }
        }
    }

    unsafe fn write(bytes: &[u8]) {
        if in_thread_mode() {
            // SAFETY: see `Encoder`.
            unsafe { (*ENCODER.0.get()).write(bytes, put) }
        }
    }
}
