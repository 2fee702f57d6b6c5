//! The coordinator's image on this board: its peripherals, given to the tasks of [`crate::board::coordinator`].
//!
//! TC4 wakes the control task, which runs in the interrupt executor; the other three tasks run in thread mode.

use cortex_m::peripheral::syst::SystClkSource;
use embassy_executor::Executor;
use static_cell::StaticCell;

use super::boot::BootReport;
use super::can::Can;
use super::nvm::Nvm;
use super::spi::{Delay, Spi};
use super::tick::{self, Ticks};
use super::uart::Uart;
use super::watchdog::Watchdog;
use super::wiring::{COORDINATOR_ACCEPTS, LED};
use super::{clocks, dma, executor, fault, log, time_driver};
use crate::board::coordinator::{self as shared, Control, HostLink, House, PERIOD_US, Turns};
use crate::coordinator::Coordinator;
use crate::store::Store;

/// Which board, for the hello.
const BOARD: u8 = 1;

/// What a failed start could not set up.
const NOT_TWICE: &str = "each peripheral is set up once";

/// Sets everything up and runs. Call once, from `main`.
pub fn run() -> ! {
    // Step by step, each with a stack frame that is gone before the next: this one stays for ever.
    let report = wake_up();
    let nvm = Nvm::start();
    let (store, stored) = shared::recall(&nvm);
    let can = begin(shared::born(&report, BOARD, stored));
    static SLOW: StaticCell<Executor> = StaticCell::new();
    SLOW.init_with(Executor::new).run(|spawner| {
        spawner.spawn(bus(can).expect(NOT_TWICE));
        spawner.spawn(storing(store, nvm).expect(NOT_TWICE));
        spawner.spawn(housekeeping(Keeper(Watchdog::start())).expect(NOT_TWICE));
    })
}

#[inline(never)]
fn wake_up() -> BootReport {
    log::start();
    // SAFETY: the first to touch the core's peripherals.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    // Runs freely while the crystal starts: the source of the boot nonce.
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(0x00ff_ffff);
    core.SYST.clear_current();
    core.SYST.enable_counter();
    let report = fault::report(clocks::start());
    core.SYST.disable_counter();
    time_driver::start();
    dma::start();
    report.log("coordinator");
    report
}

/// The control task runs when this returns.
#[inline(never)]
fn begin(coordinator: &'static mut Coordinator) -> Can {
    let can = Can::start(COORDINATOR_ACCEPTS).expect(NOT_TWICE);
    let uart = Uart::start().expect(NOT_TWICE);
    let spi = Spi::start();
    let control = Control::new(Ticks::start(PERIOD_US), spi, uart, Delay);
    executor::start().spawn(turns(control, coordinator).expect(NOT_TWICE));
    can
}

impl Turns for Ticks {
    async fn next(&mut self) {
        Ticks::next(self).await;
    }
}

impl HostLink for Uart {
    fn read(&mut self, into: &mut [u8]) -> usize {
        Uart::read(self, into)
    }
    fn is_free(&mut self) -> bool {
        Uart::is_free(self)
    }
    fn send(&mut self, frame: &[u8]) {
        Uart::send(self, frame);
    }
}

struct Keeper(Watchdog);

impl House for Keeper {
    fn feed(&mut self) {
        self.0.feed();
    }
    fn light(&mut self, on: bool) {
        LED.pin.set(!on);
    }
    fn turns(&self) -> (u32, u32) {
        (tick::raised(), tick::overruns())
    }
}

#[embassy_executor::task]
fn turns(io: Control<Ticks, Spi, Uart, Delay>, coordinator: &'static mut Coordinator) -> impl Future<Output = ()> {
    shared::turns(io, coordinator)
}

#[embassy_executor::task]
fn bus(can: Can) -> impl Future<Output = ()> {
    shared::bus(can)
}

#[embassy_executor::task]
fn storing(store: &'static mut Store, nvm: Nvm) -> impl Future<Output = ()> {
    shared::storing(store, nvm)
}

#[embassy_executor::task]
fn housekeeping(house: Keeper) -> impl Future<Output = ()> {
    LED.pin.switch(LED.function);
    shared::housekeeping(house)
}
