//! SERCOM, ADC and DMAC, driven through their registers.

#[path = "support/bench.rs"]
mod bench;

use bench::{connect, run};
use samc21::pins::Function;
use samc21::wires::{Serial, SpiLink, Uart, UartByte};
use samc21::{Chip, Cycles, ImuDevice, Kind, Width};

const SRAM: u32 = 0x2000_0000;
const DESCRIPTORS: u32 = SRAM + 0x400;
const PROGRESS: u32 = SRAM + 0x500;
const DMAC: u32 = 0x4100_6000;
const SERCOM1: u32 = 0x4200_0800;
const SERCOM4: u32 = 0x4200_1400;
const ADC0: u32 = 0x4200_4400;

const VALID: u32 = 1;
const HALF: u32 = 1 << 8;
const SOURCE: u32 = 1 << 10;
const DESTINATION: u32 = 1 << 11;

fn byte(chip: &mut Chip, address: u32, value: u32) {
    chip.bus_write(address, Width::Byte, value);
}

fn half(chip: &mut Chip, address: u32, value: u32) {
    chip.bus_write(address, Width::Half, value);
}

fn word(chip: &mut Chip, address: u32, value: u32) {
    chip.bus_write(address, Width::Word, value);
}

fn kinds(chip: &Chip) -> Vec<Kind> {
    chip.violations().iter().map(|violation| violation.kind).collect()
}

/// SERCOM4 as UART at 1 Mbaud on PB10 and PB11, both directions.
fn uart() -> Chip {
    let mut chip = bench::chip(&[23]);
    connect(&mut chip, 1, 10, Function::D);
    connect(&mut chip, 1, 11, Function::D);
    chip.wires_mut().serial[4] = Serial::Uart(Uart::default());
    word(&mut chip, SERCOM4, 1);
    run(&mut chip, 1);
    let control = 1 << 2 | 1 << 13 | 1 << 16 | 3 << 20 | 1 << 30;
    word(&mut chip, SERCOM4, control);
    half(&mut chip, SERCOM4 + 0x0c, 3);
    word(&mut chip, SERCOM4 + 0x04, 3 << 16);
    word(&mut chip, SERCOM4, control | 2);
    run(&mut chip, 1);
    assert_eq!(kinds(&chip), []);
    chip
}

fn dmac(chip: &mut Chip) {
    half(chip, DMAC, 1);
    word(chip, DMAC + 0x34, DESCRIPTORS);
    word(chip, DMAC + 0x38, PROGRESS);
    half(chip, DMAC, 2 | 1 << 8);
}

/// Starts `channel` with a descriptor: control, count, source, destination, next.
fn transfer(chip: &mut Chip, channel: u32, trigger: u32, descriptor: [u32; 5]) {
    let [control, count, source, destination, next] = descriptor;
    let at = DESCRIPTORS + 16 * channel;
    for (offset, value) in [(0, control | count << 16), (4, source), (8, destination), (12, next)] {
        word(chip, at + offset, value);
    }
    byte(chip, DMAC + 0x3f, channel);
    byte(chip, DMAC + 0x40, 1);
    word(chip, DMAC + 0x44, trigger << 8 | 2 << 22);
    byte(chip, DMAC + 0x4e, 7);
    byte(chip, DMAC + 0x40, 2);
}

fn sent(chip: &mut Chip) -> Vec<UartByte> {
    match &mut chip.wires_mut().serial[4] {
        Serial::Uart(uart) => uart.from_chip.drain(..).collect(),
        _ => vec![],
    }
}

fn arrive(chip: &mut Chip, bytes: &[u8]) {
    let mut at = chip.now();
    if let Serial::Uart(uart) = &mut chip.wires_mut().serial[4] {
        for byte in bytes {
            at += 480;
            uart.to_chip.push_back(UartByte { at, byte: *byte, framing_error: false });
        }
    }
}

#[test]
fn a_uart_sends_a_byte_in_ten_bits_and_the_next_without_a_gap() {
    let mut chip = uart();
    let start = chip.now();
    half(&mut chip, SERCOM4 + 0x28, 0x55);
    half(&mut chip, SERCOM4 + 0x28, 0xaa);
    assert_eq!(chip.bus_read(SERCOM4 + 0x18, Width::Byte) & 1, 0, "the buffer is full");
    run(&mut chip, 30);
    let bytes = sent(&mut chip);
    assert_eq!(bytes.iter().map(|byte| byte.byte).collect::<Vec<_>>(), [0x55, 0xaa]);
    assert!((480..500).contains(&bytes[0].at.since(start)));
    assert_eq!(bytes[1].at - bytes[0].at, 480);
    assert_eq!(chip.bus_read(SERCOM4 + 0x18, Width::Byte) & 3, 3, "ready, and complete");
    assert_eq!(kinds(&chip), []);
}

#[test]
fn arithmetic_and_fractional_baud_rates_give_the_times_of_the_data_sheet() {
    for (sampling, baud, ticks) in [
        // 48 MHz / 16 * (1 - 63019 / 65536) = 115.2 kbaud
        (0, 63_019, 10.0 * 48e6 / (48e6 / 16.0 * (1.0 - 63_019.0 / 65_536.0))),
        // 48 MHz / (16 * (26 + 1 / 8))
        (1, 26 | 1 << 13, 10.0 * 16.0 * 26.125),
        (3, 52 | 1 << 13, 10.0 * 8.0 * 52.125),
    ] {
        let mut chip = uart();
        let control = 1 << 2 | sampling << 13 | 1 << 16 | 3 << 20 | 1 << 30;
        let old = chip.bus_read(SERCOM4, Width::Word);
        word(&mut chip, SERCOM4, old & !2);
        run(&mut chip, 1);
        word(&mut chip, SERCOM4, control);
        half(&mut chip, SERCOM4 + 0x0c, baud);
        word(&mut chip, SERCOM4, control | 2);
        run(&mut chip, 1);
        half(&mut chip, SERCOM4 + 0x28, 1);
        half(&mut chip, SERCOM4 + 0x28, 2);
        run(&mut chip, 500);
        let bytes = sent(&mut chip);
        assert!(((bytes[1].at - bytes[0].at) as f64 - ticks).abs() < 1.0, "{sampling}: {bytes:?}, {ticks}");
    }
}

#[test]
fn a_third_byte_that_nobody_fetched_is_lost_with_a_flag() {
    let mut chip = uart();
    arrive(&mut chip, &[1, 2, 3]);
    run(&mut chip, 40);
    assert_eq!(chip.bus_read(SERCOM4 + 0x1a, Width::Half), 1 << 2);
    let read: Vec<u32> = (0..2).map(|_| chip.bus_read(SERCOM4 + 0x28, Width::Half)).collect();
    assert_eq!(read, [1, 2]);
    assert_eq!(chip.bus_read(SERCOM4 + 0x18, Width::Byte) & 4, 0);
}

#[test]
fn settings_of_an_enabled_sercom_are_protected() {
    let mut chip = uart();
    half(&mut chip, SERCOM4 + 0x0c, 7);
    word(&mut chip, SERCOM4 + 0x04, 3 << 16 | 1 << 6);
    assert_eq!(kinds(&chip), [Kind::EnableProtected; 2]);
    assert_eq!(chip.bus_read(SERCOM4 + 0x0c, Width::Half), 3);
}

#[test]
fn a_write_before_the_last_has_crossed_is_reported() {
    let mut chip = uart();
    word(&mut chip, SERCOM4 + 0x04, 2 << 16);
    word(&mut chip, SERCOM4 + 0x04, 3 << 16);
    assert_eq!(kinds(&chip), [Kind::SyncBusy]);
}

#[test]
fn a_uart_without_pins_or_core_clock_is_reported() {
    let mut chip = bench::chip(&[]);
    let control = 1 << 2 | 1 << 13 | 1 << 16 | 3 << 20 | 1 << 30;
    word(&mut chip, SERCOM4, control);
    word(&mut chip, SERCOM4 + 0x04, 3 << 16);
    word(&mut chip, SERCOM4, control | 2);
    assert_eq!(kinds(&chip)[0], Kind::Unclocked);
    assert_eq!(kinds(&chip).len(), 3);
    run(&mut chip, 1000);
    assert_eq!(chip.bus_read(SERCOM4 + 0x1c, Width::Word) & 2, 2, "enabling never ends");
}

#[test]
fn dma_sends_a_frame_at_the_speed_of_the_line() {
    let mut chip = uart();
    dmac(&mut chip);
    for index in 0..20 {
        byte(&mut chip, SRAM + index, index + 1);
    }
    transfer(&mut chip, 2, 11, [VALID | SOURCE, 20, SRAM + 20, SERCOM4 + 0x28, 0]);
    run(&mut chip, 100);
    byte(&mut chip, DMAC + 0x3f, 2);
    // Half are out; two more are in shifter and buffer.
    let left = chip.bus_read(PROGRESS + 32 + 2, Width::Half);
    assert!((8..=9).contains(&left), "{left}");
    assert_eq!(chip.bus_read(DMAC + 0x40, Width::Byte), 2);
    run(&mut chip, 150);
    let bytes: Vec<u8> = sent(&mut chip).iter().map(|byte| byte.byte).collect();
    assert_eq!(bytes, (1..=20).collect::<Vec<u8>>());
    assert_eq!(chip.bus_read(DMAC + 0x40, Width::Byte), 0, "done, so off");
    assert_eq!(chip.bus_read(DMAC + 0x4e, Width::Byte), 2, "transfer complete");
    assert_eq!(kinds(&chip), []);
}

#[test]
fn dma_receives_into_a_ring_for_ever() {
    let mut chip = uart();
    dmac(&mut chip);
    let ring = DESCRIPTORS + 16;
    transfer(&mut chip, 1, 10, [VALID | DESTINATION, 8, SERCOM4 + 0x28, SRAM + 0x108, ring]);
    arrive(&mut chip, &(0..20).collect::<Vec<u8>>());
    run(&mut chip, 250);
    let ring: Vec<u32> = (0..8).map(|index| chip.bus_read(SRAM + 0x100 + index, Width::Byte)).collect();
    assert_eq!(ring, [16, 17, 18, 19, 12, 13, 14, 15]);
    assert_eq!(chip.bus_read(PROGRESS + 16 + 2, Width::Half), 4);
    assert_eq!(chip.bus_read(SERCOM4 + 0x1a, Width::Half), 0, "nothing was lost");
    assert_eq!(kinds(&chip), []);
}

#[test]
fn dma_with_a_descriptor_that_is_not_valid_suspends_its_channel() {
    let mut chip = uart();
    dmac(&mut chip);
    transfer(&mut chip, 2, 11, [SOURCE, 1, SRAM, SERCOM4 + 0x28, 0]);
    assert_eq!(kinds(&chip), [Kind::Misuse("DMA descriptor is not valid")]);
    assert_eq!(chip.bus_read(DMAC + 0x4e, Width::Byte), 4);
    assert_eq!(chip.bus_read(DMAC + 0x4f, Width::Byte), 4);
}

#[test]
fn dma_to_where_nothing_is_ends_with_an_error_not_a_fault() {
    let mut chip = uart();
    dmac(&mut chip);
    transfer(&mut chip, 2, 11, [VALID, 1, SRAM, 0x5000_0000, 0]);
    assert_eq!(chip.bus_read(DMAC + 0x4e, Width::Byte), 1);
    assert_eq!(kinds(&chip), [Kind::Unmapped]);
    run(&mut chip, 10);
    assert_eq!(kinds(&chip).len(), 1, "the CPU sleeps on");
}

#[test]
fn dma_by_software_runs_through_linked_descriptors() {
    let mut chip = uart();
    dmac(&mut chip);
    for index in 0..4 {
        word(&mut chip, SRAM + 4 * index, 0x1111 * (index + 1));
    }
    // The second block: two words, every second place.
    let second = SRAM + 0x300;
    let control = VALID | 2 << 8 | SOURCE | DESTINATION | 1 << 13;
    for (offset, value) in [(0, control | 2 << 16), (4, SRAM + 16), (8, SRAM + 0x210), (12, 0)] {
        word(&mut chip, second + offset, value);
    }
    let first = [VALID | 2 << 8 | SOURCE | DESTINATION | 1 << 3, 2, SRAM + 8, SRAM + 0x108, second];
    transfer(&mut chip, 3, 0, first);
    byte(&mut chip, DMAC + 0x40, 0);
    word(&mut chip, DMAC + 0x44, 3 << 22);
    byte(&mut chip, DMAC + 0x40, 2);
    word(&mut chip, DMAC + 0x10, 1 << 3);
    let words: Vec<u32> = [0x100, 0x104, 0x200, 0x204, 0x208].map(|at| chip.bus_read(SRAM + at, Width::Word)).to_vec();
    assert_eq!(words, [0x1111, 0x2222, 0x3333, 0, 0x4444]);
    assert_eq!(chip.bus_read(DMAC + 0x4e, Width::Byte), 2);
    assert_eq!(kinds(&chip), []);
}

/// SERCOM1 as SPI host at 6 MHz on PA16 (in), PA18 (out), PA19 (clock), select on PA17.
fn spi() -> Chip {
    let mut chip = bench::chip(&[20]);
    for pin in [16, 18, 19] {
        connect(&mut chip, 0, pin, Function::C);
    }
    let mut sensor = ImuDevice::default();
    sensor.set([0x1234, 0, 0], [0; 3]);
    chip.wires_mut().serial[1] = Serial::Spi(SpiLink::new(sensor, (0, 17)));
    // Select: high, then an output.
    word(&mut chip, 0x4100_0018, 1 << 17);
    word(&mut chip, 0x4100_0008, 1 << 17);
    let control = 3 << 2 | 1 << 16;
    word(&mut chip, SERCOM1, control);
    byte(&mut chip, SERCOM1 + 0x0c, 3);
    word(&mut chip, SERCOM1 + 0x04, 1 << 17);
    word(&mut chip, SERCOM1, control | 2);
    run(&mut chip, 10);
    assert_eq!(kinds(&chip), []);
    chip
}

/// One transfer with the select low.
fn exchange(chip: &mut Chip, bytes: &[u8]) -> Vec<u8> {
    word(chip, 0x4100_0014, 1 << 17);
    let mut answer = vec![];
    for byte in bytes {
        word(chip, SERCOM1 + 0x28, (*byte).into());
        run(chip, 2);
        assert_eq!(chip.bus_read(SERCOM1 + 0x18, Width::Byte) & 4, 4, "received");
        answer.push(chip.bus_read(SERCOM1 + 0x28, Width::Word) as u8);
    }
    word(chip, 0x4100_0018, 1 << 17);
    answer
}

#[test]
fn an_spi_host_talks_to_the_device_its_pin_selects() {
    let mut chip = spi();
    // The first transfer only tells the sensor that this is SPI.
    exchange(&mut chip, &[0x80]);
    assert_eq!(exchange(&mut chip, &[0x80, 0, 0, 0])[2..], [0x43, 0x00]);
    exchange(&mut chip, &[0x20, 0xbc, 0x70]);
    assert_eq!(exchange(&mut chip, &[0x83, 0, 0, 0])[2..], [0x34, 0x12]);
    assert_eq!(kinds(&chip), []);
}

#[test]
fn an_spi_byte_takes_eight_clocks() {
    let mut chip = spi();
    word(&mut chip, SERCOM1 + 0x28, 0);
    let now = chip.now();
    // 48 MHz / (2 * (3 + 1)) = 6 MHz: 64 ticks.
    chip.run_until(Cycles(now.0 + 63));
    assert_eq!(chip.bus_read(SERCOM1 + 0x18, Width::Byte) & 4, 0);
    chip.run_until(now + 70);
    assert_eq!(chip.bus_read(SERCOM1 + 0x18, Width::Byte) & 4, 4);
    assert_eq!(chip.bus_read(SERCOM1 + 0x28, Width::Word), 0xff, "nobody is selected");
}

/// ADC0 on inputs 2, 3 (PB08, PB09) and 8 (PA08), supply as reference, 12 MHz.
fn adc() -> Chip {
    let mut chip = bench::chip(&[33]);
    for (group, pin) in [(1, 8), (1, 9), (0, 8)] {
        connect(&mut chip, group, pin, Function::B);
    }
    let wires = chip.wires_mut();
    wires.supply = 3.3;
    wires.analog[0][2] = 3.3 * 0.25;
    wires.analog[0][3] = 3.3 * 0.5;
    wires.analog[0][8] = 5.0;
    let factory = chip.bus_read(0x0080_6020, Width::Word);
    half(&mut chip, ADC0 + 0x2c, factory >> 3 & 7 | (factory & 7) << 8);
    byte(&mut chip, ADC0 + 0x01, 1);
    byte(&mut chip, ADC0 + 0x02, 5);
    half(&mut chip, ADC0 + 0x08, 24 << 8);
    byte(&mut chip, ADC0 + 0x0d, 4);
    word(&mut chip, ADC0 + 0x28, 1 << 2 | 1 << 3 | 1 << 8);
    byte(&mut chip, ADC0, 2);
    run(&mut chip, 10);
    assert_eq!(kinds(&chip), []);
    chip
}

#[test]
fn a_scan_by_dma_reads_the_inputs_in_order() {
    let mut chip = adc();
    dmac(&mut chip);
    transfer(&mut chip, 0, 42, [VALID | HALF | DESTINATION, 3, ADC0 + 0x24, SRAM + 6, 0]);
    byte(&mut chip, ADC0 + 0x18, 2);
    assert_eq!(chip.bus_read(ADC0 + 0x07, Width::Byte), 0x82, "busy with input 2");
    run(&mut chip, 4);
    // Three conversions of 5 + 13 cycles at 12 MHz are 4.5 µs.
    assert_eq!(chip.bus_read(DMAC + 0x4e, Width::Byte), 0);
    run(&mut chip, 1);
    assert_eq!(chip.bus_read(DMAC + 0x4e, Width::Byte), 2);
    let counts: Vec<u32> = (0..3).map(|index| chip.bus_read(SRAM + 2 * index, Width::Half)).collect();
    assert_eq!(counts, [1024, 2048, 4095]);
    assert_eq!(chip.bus_read(ADC0 + 0x06, Width::Byte), 0, "no overrun, and the last result was fetched");
    assert_eq!(kinds(&chip), []);
}

#[test]
fn results_that_nobody_fetches_overrun() {
    let mut chip = adc();
    byte(&mut chip, ADC0 + 0x18, 2);
    run(&mut chip, 10);
    assert_eq!(chip.bus_read(ADC0 + 0x06, Width::Byte), 3);
    assert_eq!(chip.bus_read(ADC0 + 0x24, Width::Half), 4095, "the last one");
}

#[test]
fn averaging_takes_as_many_times_longer() {
    let mut chip = adc();
    byte(&mut chip, ADC0 + 0x0c, 4 | 4 << 4);
    half(&mut chip, ADC0 + 0x0a, 1 << 4);
    word(&mut chip, ADC0 + 0x28, 1 << 3);
    run(&mut chip, 1);
    byte(&mut chip, ADC0 + 0x18, 2);
    run(&mut chip, 23);
    assert_eq!(chip.bus_read(ADC0 + 0x06, Width::Byte), 0);
    run(&mut chip, 2);
    assert_eq!(chip.bus_read(ADC0 + 0x24, Width::Half), 2048);
}

#[test]
fn what_an_adc_would_suffer_from_is_reported() {
    let mut chip = adc();
    byte(&mut chip, ADC0 + 0x01, 0);
    assert_eq!(kinds(&chip), [Kind::EnableProtected]);
    chip.context_mut().take_violations();
    byte(&mut chip, ADC0, 0);
    run(&mut chip, 1);
    byte(&mut chip, ADC0 + 0x01, 0);
    half(&mut chip, ADC0 + 0x2c, 0);
    byte(&mut chip, ADC0, 2);
    assert_eq!(
        kinds(&chip),
        [Kind::Misuse("ADC clock above 16 MHz"), Kind::Misuse("ADC without the factory's calibration")]
    );
    word(&mut chip, ADC0 + 0x28, 1 << 9);
    run(&mut chip, 1);
    byte(&mut chip, ADC0 + 0x18, 2);
    assert_eq!(kinds(&chip)[2], Kind::Misuse("conversion of an input whose pin is not analogue"));
}
