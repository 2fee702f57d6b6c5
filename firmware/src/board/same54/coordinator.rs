//! The coordinator's image on this board: everything is set up through the HAL and given to the tasks of
//! [`crate::board::coordinator`].
//!
//! ```text
//!  XOSC1 12 MHz ─► ÷6 ─► DPLL0 × 60 = 120 MHz ─┬─► generator 0: 120 MHz  CPU, buses
//!                                              ├─► ÷3  generator 1: 40 MHz  CAN, SERCOM
//!                                              └─► ÷15 generator 2: 8 MHz  timers
//! ```
//!
//! CAN-FD needs a crystal. If it does not start, or the PLL does not lock, the image resets, over and over, and stays silent: nodes without a
//! coordinator brake. UNVERIFIED: that the board's 12 MHz crystal sits at XOSC1 (PB22, PB23); public board supports say
//! so, the pages of the user guide at hand do not show it.

use atsamd_hal::clock::v2::dpll::Dpll;
use atsamd_hal::clock::v2::gclk::{Gclk, GclkDiv8, GclkDiv16};
use atsamd_hal::clock::v2::pclk::Pclk;
use atsamd_hal::clock::v2::xosc::Xosc;
use atsamd_hal::clock::v2::{Source, clock_system_at_reset};
use atsamd_hal::ehal::digital::OutputPin;
use atsamd_hal::ehal::spi::MODE_0;
use atsamd_hal::fugit::RateExtU32;
use atsamd_hal::gpio::{Output, PB26, PB27, PB28, PB29, PC18, Pin, Pins, PushPull};
use atsamd_hal::pac::{Interrupt, Peripherals, interrupt};
use atsamd_hal::sercom::uart::{BaudMode, Oversampling};
use atsamd_hal::sercom::{Sercom4, spi, uart as hal_uart};
use atsamd_hal::timer::TimerCounter4;
use atsamd_hal::trng::Trng;
use atsamd_hal::{ResetCause as Rcause, reset_cause};
use embassy_executor::{Executor, InterruptExecutor};
use embedded_hal::delay::DelayNs;
use embedded_hal_bus::spi::ExclusiveDevice;
use sarah_protocol::telemetry::ResetCause;
use static_cell::StaticCell;

use super::can::{self, Can};
use super::nvm::Nvm;
use super::tick::{self, Ticks};
use super::uart::{BAUD, Uart};
use super::watchdog::Watchdog;
use super::{CPU_HZ, FAST_HZ, TIMER_HZ, priority, time_driver};
use crate::board::boot::{BootReport, ClockSource};
use crate::board::coordinator::{self as shared, Control, House};
use crate::board::samc21::wiring::COORDINATOR_ACCEPTS;
use crate::board::{fault, log};
use crate::coordinator::Coordinator;
use crate::store::Store;

/// Which board, for the hello.
const BOARD: u8 = 2;
/// The IMU takes 10 MHz at most.
const SPI_HZ: u32 = 5_000_000;
/// Polls for crystal and PLL, of at least ten cycles at 48 MHz: two tenths of a second.
const PATIENCE: u32 = 1_000_000;

/// What a failed start could not set up.
const NOT_TWICE: &str = "each peripheral is set up once";

type Select = Pin<PB28, Output<PushPull>>;
type Led = Pin<PC18, Output<PushPull>>;
type Bus = spi::Spi<spi::Config<spi::PadsFromIds<Sercom4, PB29, PB27, PB26>>, spi::Duplex>;
type Imu = ExclusiveDevice<Bus, Select, Delay>;

/// Waiting by counting cycles; for setting up.
struct Delay;

impl DelayNs for Delay {
    fn delay_ns(&mut self, ns: u32) {
        cortex_m::asm::delay(ns.div_ceil(1000).saturating_mul(CPU_HZ / 1_000_000));
    }
}

/// The peripherals, set up.
struct Board {
    report: BootReport,
    can: Can,
    uart: Uart,
    imu: Imu,
    timer: TimerCounter4,
    nvm: Nvm,
    keeper: Keeper,
}

/// Sets everything up and runs. Call once, from `main`.
pub fn run() -> ! {
    let Board { report, can, uart, imu, timer, nvm, keeper } = set_up();
    let (store, stored) = shared::recall(&nvm);
    let coordinator = shared::born(&report, BOARD, stored);
    let control = Control::new(Ticks::start(timer), imu, uart, Delay);
    // SAFETY: before the executor starts; no critical section relies on this priority.
    unsafe { cortex_m::Peripherals::steal().NVIC.set_priority(Interrupt::PCC, priority::CONTROL) };
    CONTROL.start(Interrupt::PCC).spawn(turns(control, coordinator).expect(NOT_TWICE));
    static SLOW: StaticCell<Executor> = StaticCell::new();
    SLOW.init_with(Executor::new).run(|spawner| {
        spawner.spawn(bus(can).expect(NOT_TWICE));
        spawner.spawn(storing(store, nvm).expect(NOT_TWICE));
        spawner.spawn(housekeeping(keeper).expect(NOT_TWICE));
    })
}

#[inline(never)]
fn set_up() -> Board {
    log::start();
    let mut chip = Peripherals::take().expect(NOT_TWICE);
    let pins = Pins::new(chip.port);
    let (_, clocks, tokens) =
        clock_system_at_reset(chip.oscctrl, chip.osc32kctrl, chip.gclk, chip.mclk, &mut chip.nvmctrl);
    let crystal = Xosc::from_crystal(tokens.xosc1, pins.pb22, pins.pb23, 12.MHz());
    // On demand it would wait for somebody to use it, and never be ready.
    let crystal = crystal.loop_control(true).on_demand(false).enable();
    assert!((0..PATIENCE).any(|_| crystal.is_ready()), "the crystal did not start");
    let (dpll, _crystal) = Dpll::from_xosc(tokens.dpll0, crystal);
    // The lock is judged below; afterwards a lock detector that blinks must not stop the CPU's clock.
    let dpll = dpll.prediv(6).loop_div(60, 0).on_demand(false).lock_bypass(true).enable();
    assert!((0..PATIENCE).any(|_| dpll.is_locked() && dpll.is_ready()), "the PLL did not lock");
    let (fast, dpll) = Gclk::from_source(tokens.gclks.gclk1, dpll);
    let fast = fast.div(GclkDiv16::Div(3)).enable();
    let (slow, dpll) = Gclk::from_source(tokens.gclks.gclk2, dpll);
    let slow = slow.div(GclkDiv8::Div(15)).enable();
    let (main, _dfll, _dpll) = clocks.gclk0.swap_sources(clocks.dfll, dpll);
    assert!(main.freq().to_Hz() == CPU_HZ && fast.freq().to_Hz() == FAST_HZ && slow.freq().to_Hz() == TIMER_HZ);
    // SAFETY: from here on MCLK is used while setting up only, for peripherals whose clocks the typed tree does not hold.
    let (_, _, _, mut mclk) = unsafe { clocks.pac.steal() };

    let cause = reported(reset_cause(&chip.rstc));
    let entropy = Trng::new(&mut mclk, chip.trng).random_u32();
    let report = fault::report(cause, ClockSource::Crystal, entropy);
    let (pclk, slow) = Pclk::enable(tokens.pclks.tc0_tc1, slow);
    time_driver::start(pclk, &mclk, chip.tc0, chip.tc1);
    report.log("coordinator");

    let (pclk, _slow) = Pclk::enable(tokens.pclks.tc4_tc5, slow);
    let timer = TimerCounter4::tc4_(&pclk.into(), chip.tc4, &mut mclk);

    let (pclk, fast) = Pclk::enable(tokens.pclks.sercom2, fast);
    let pads = hal_uart::Pads::default().rx(pins.pb24).tx(pins.pb25);
    let port = hal_uart::Config::new(&mclk, chip.sercom2, pads, pclk.freq())
        .baud(BAUD.Hz(), BaudMode::Fractional(Oversampling::Bits16))
        .enable();

    let (pclk, fast) = Pclk::enable(tokens.pclks.sercom4, fast);
    let pads = spi::Pads::default().data_in(pins.pb29).data_out(pins.pb27).sclk(pins.pb26);
    let bus = spi::Config::new(&mclk, chip.sercom4, pads, pclk.freq()).spi_mode(MODE_0).baud(SPI_HZ.Hz()).enable();
    let mut select: Select = pins.pb28.into();
    let Ok(()) = select.set_high();
    let Ok(imu) = ExclusiveDevice::new(bus, select, Delay);

    let mut standby: Pin<_, Output<PushPull>> = pins.pc13.into();
    let Ok(()) = standby.set_low();
    let (pclk, _fast) = Pclk::enable(tokens.pclks.can1, fast);
    let (rx, tx) = (pins.pb13.into_mode(), pins.pb12.into_mode());
    let (ready, _main) = can::Ready::new(main, pclk, clocks.ahbs.can1, rx, tx, chip.can1);
    Board {
        report,
        can: can::start(ready, COORDINATOR_ACCEPTS).expect(NOT_TWICE),
        uart: Uart::start(port),
        imu,
        timer,
        nvm: Nvm::start(chip.nvmctrl),
        keeper: Keeper { led: pins.pc18.into(), watchdog: Watchdog::start(chip.wdt) },
    }
}

fn reported(cause: Rcause) -> ResetCause {
    match cause {
        Rcause::POR => ResetCause::PowerOn,
        Rcause::BOD12 | Rcause::BOD33 => ResetCause::BrownOut,
        Rcause::External => ResetCause::External,
        Rcause::Watchdog => ResetCause::Watchdog,
        Rcause::System => ResetCause::Software,
        _ => ResetCause::Unknown,
    }
}

struct Keeper {
    led: Led,
    watchdog: Watchdog,
}

impl House for Keeper {
    fn feed(&mut self) {
        self.watchdog.feed();
    }
    fn light(&mut self, on: bool) {
        let Ok(()) = self.led.set_state((!on).into());
    }
    fn turns(&self) -> (u32, u32) {
        tick::counts()
    }
}

/// The control task's executor: in the line of a peripheral this firmware does not use.
static CONTROL: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
fn PCC() {
    // SAFETY: called from its interrupt, which is enabled by `CONTROL.start`.
    unsafe { CONTROL.on_interrupt() }
}

#[embassy_executor::task]
fn turns(io: Control<Ticks, Imu, Uart, Delay>, coordinator: &'static mut Coordinator) -> impl Future<Output = ()> {
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
fn housekeeping(keeper: Keeper) -> impl Future<Output = ()> {
    shared::housekeeping(keeper)
}
