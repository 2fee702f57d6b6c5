use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use mcap::read::{MessageStream, Options};
use prost_reflect::{DescriptorPool, DynamicMessage, Value};
use sarah_protocol::params::SPECS;
use sarah_sim::scenario::{Episode, Push};
use sarah_sim::sil::{Sil, SilConfig};
use serialport::{SerialPort, TTYPort};

use super::live::Listening;
use super::reader::Recording;
use super::replay::{Difference, Replayer};
use super::simulated::Simulation;
use super::tape::{Entry, Passed, entries};
use super::*;
use crate::link::port::Target;

/// A robot that is pushed once it stands, ticking at `lpg_rate_hz`.
fn simulation(seconds: f64, lpg_rate_hz: u32) -> Simulation {
    let push = Push { at_s: 1.5, impulse_n_s: 16.0, direction_deg: 30.0, duration_s: 0.1, height_m: 0.0 };
    let episode = Episode {
        index: 0,
        seed: 5,
        duration_s: seconds as f32,
        settle_s: 1.0,
        drop_m: 0.01,
        pushes: vec![push],
        direction: None,
    };
    let config = SilConfig { lpg_rate_hz, ..SilConfig::default() };
    Simulation { config, episode, seconds, rate_hz: lpg_rate_hz.min(1000) as u16 }
}

fn about() -> About {
    About::default().with("link", "sim")
}

fn run(simulation: &Simulation, path: &Path) -> Recorder {
    let mut recorder = Recorder::create(path, about()).expect("a new file");
    let ended = simulation.record(&mut recorder, &AtomicBool::new(false), &mut |_| {}).expect("runs");
    assert_eq!(ended.seconds, simulation.seconds, "{ended:?}");
    recorder
}

/// A finished recording in a folder of its own.
fn recorded(simulation: &Simulation) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mcap");
    run(simulation, &path).finish().expect("finishes");
    (folder, path)
}

fn tape_of(path: &Path) -> Vec<Entry> {
    let tape = Recording::read(path).expect("reads").tape;
    entries(&tape).map(|(entry, _)| entry.expect("decodes")).collect()
}

fn replay_tape(entries: impl IntoIterator<Item = Entry>) -> Result<replay::Compared, Difference> {
    let mut entries = entries.into_iter();
    let Some(Entry::Born(born)) = entries.next() else { panic!("begins with a power-up") };
    let mut replayer = Replayer::new(&born).expect("sets of this build");
    for entry in entries {
        let Entry::Passed { at_us, chip, what } = entry else { panic!("one power-up") };
        replayer.passed(at_us, chip, what)?;
    }
    replayer.finish()
}

#[test]
fn a_recording_of_the_library_replays_identically() {
    let (_folder, path) = recorded(&simulation(4.0, 100));
    let replayed = replay(&path, &mut |_| {}).expect("identical");
    let compared = replayed.control.expect("a simulated robot has a tape");
    assert_eq!(compared.ticks, 4 * 400, "four chips, 100 ticks a second");
    assert_eq!(compared.commands, 4 * 600);
    assert!(compared.frames > 1_500 && compared.bytes > 20_000, "{compared:?}");
    assert!(replayed.complete);
    // It did something worth replaying.
    let steps = Recording::read(&path).expect("reads").telemetry.last().map_or(0, |frame| frame.steps);
    assert!(steps > 0, "the push makes it step");
}

#[test]
fn a_flipped_input_is_the_first_difference_at_its_tick() {
    let (_folder, path) = recorded(&simulation(2.5, 100));
    let tape = tape_of(&path);
    for (chip, target) in [(0, 120), (1, 150), (2, 200), (3, 30)] {
        let mut tick = 0;
        let flipped = tape.iter().cloned().map(|mut entry| {
            if let Entry::Passed { chip: at, what, .. } = &mut entry
                && *at == chip
                && matches!(what, Passed::Tick { .. } | Passed::Turn { .. })
            {
                tick += 1;
                match what {
                    // The lowest bit of a position is a step of the status message, of the IMU one of the motion message.
                    Passed::Tick { position, .. } if tick == target => position[1] ^= 1,
                    Passed::Turn { gyro, .. } if tick == target => gyro[1] ^= 1,
                    _ => {}
                }
            }
            entry
        });
        let found = replay_tape(flipped).expect_err("a bit is another");
        assert_eq!((found.node, found.tick), (tape::node(chip), target), "{found}");
    }
}

#[test]
fn a_changed_parameter_is_found_where_it_first_acts() {
    let (_folder, path) = recorded(&simulation(4.0, 100));
    let mut tape = tape_of(&path);
    // The knee alone: the coordinator would tell the host of another set at once.
    tape.retain(|entry| !matches!(entry, Entry::Passed { chip: 0 | 2 | 3, .. }));
    let first_move = tape.iter().find_map(|entry| match entry {
        Entry::Passed { at_us, chip: 1, what: Passed::Commands(commands) } if *commands != [None; 2] => Some(*at_us),
        _ => None,
    });
    let Entry::Born(born) = &mut tape[0] else { panic!("begins with a power-up") };
    // P1, the speed of the kick, with which a cycle begins.
    born.default[0] = SPECS[0].min + 0.5 * (born.default[0] - SPECS[0].min);
    let found = replay_tape(tape).expect_err("another speed");
    assert_eq!((found.node, Some(found.at_us)), (tape::node(1), first_move), "{found}");
    assert!(found.to_string().starts_with("Knee, tick "), "{found}");
}

#[test]
fn a_missing_and_a_surplus_output_are_differences() {
    let (_folder, path) = recorded(&simulation(1.0, 100));
    let tape = tape_of(&path);
    let sent = tape.iter().rposition(|entry| matches!(entry, Entry::Passed { what: Passed::Sent(_), .. }));
    let sent = sent.expect("frames were sent");
    let mut missing = tape.clone();
    missing.remove(sent);
    assert_eq!(replay_tape(missing).expect_err("one too few").recorded, "nothing");
    let mut surplus = tape.clone();
    surplus.insert(sent, tape[sent].clone());
    assert_eq!(replay_tape(surplus).expect_err("one too many").replayed, "nothing");
}

#[test]
fn a_killed_recording_reads_up_to_its_last_second() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("killed.mcap");
    let recorder = run(&simulation(3.5, 100), &path);
    // As with a kill: neither the buffers are written nor the index.
    std::mem::forget(recorder);
    let recording = Recording::read(&path).expect("reads");
    assert!(!recording.complete);
    let last_us = recording.telemetry.last().expect("has telemetry").time_us;
    assert!(last_us > 2_400_000, "{last_us}");
    let replayed = replay(&path, &mut |_| {}).expect("what is there replays identically");
    assert!(replayed.control.expect("has a tape").ticks > 900);

    let whole = std::fs::read(&path).expect("reads");
    let cut = folder.path().join("cut.mcap");
    let mut frames = 0;
    for eighths in 1..8 {
        std::fs::write(&cut, &whole[..whole.len() * eighths / 8]).expect("writes");
        let telemetry = Recording::read(&cut).expect("reads wherever it is cut").telemetry.len();
        assert!(telemetry >= frames);
        frames = telemetry;
    }
    assert!(frames > 0);
}

#[test]
fn every_channel_decodes_with_its_own_schema() {
    let (_folder, path) = recorded(&simulation(2.0, 100));
    let bytes = std::fs::read(&path).expect("reads");
    let mut topics: BTreeMap<String, u32> = BTreeMap::new();
    let mut height_m = 0.0;
    for message in MessageStream::new(&bytes).expect("an MCAP file") {
        let message = message.expect("whole");
        let channel = &message.channel;
        *topics.entry(channel.topic.clone()).or_default() += 1;
        let schema = channel.schema.as_ref().expect("has a schema");
        if channel.topic == "/robot_description" {
            assert_eq!((schema.encoding.as_str(), channel.message_encoding.as_str()), ("ros2msg", "cdr"));
            assert!(message.data[8..].starts_with(b"<?xml"));
            continue;
        }
        assert_eq!(channel.message_encoding, "protobuf", "{}", channel.topic);
        let pool = DescriptorPool::decode(&*schema.data).expect("a descriptor set");
        let descriptor = pool.get_message_by_name(&schema.name).expect("named in its own schema");
        let decoded = DynamicMessage::decode(descriptor, &*message.data).expect("decodes");
        assert_eq!(decoded.unknown_fields().count(), 0, "{}", channel.topic);
        let field = |name: &str| decoded.get_field_by_name(name).expect("has the field").into_owned();
        match channel.topic.as_str() {
            "/imu" if message.log_time == 1_000_000_000 => {
                let Value::Message(acceleration) = field("acceleration_m_s2") else { panic!("a vector") };
                let z = acceleration.get_field_by_name("z").and_then(|z| z.as_f64()).expect("a number");
                assert!((z - 9.8).abs() < 0.6, "{z} m/s² at rest");
            }
            "/tf" => {
                let Value::List(transforms) = field("transforms") else { panic!("a list") };
                assert_eq!(transforms.len(), 11);
                let trunk = transforms[0].as_message().expect("a transform");
                let at = trunk.get_field_by_name("translation").expect("has the field");
                let at = at.as_message().expect("a vector");
                height_m = at.get_field_by_name("z").and_then(|z| z.as_f64()).expect("a number");
            }
            "/gait" => assert!(field("knee").as_enum_number().is_some()),
            _ => {}
        }
    }
    assert!((height_m - 0.83).abs() < 0.03, "the trunk stands at {height_m} m");
    let all = [
        "/tf",
        "/robot",
        "/robot_description",
        "/joints",
        "/imu",
        "/pads",
        "/attitude",
        "/gait",
        "/state",
        "/generation",
        "/params",
        "/link",
        "/log",
        "/raw",
        "/control",
    ];
    assert_eq!(topics.keys().map(String::as_str).collect::<BTreeSet<_>>(), BTreeSet::from(all));
    assert!(topics["/imu"] > 180 && topics["/tf"] > 90 && topics["/robot"] == 1, "{topics:?}");
}

#[test]
fn equal_seeds_make_equal_files_however_long_they_take() {
    let (_a, first) = recorded(&simulation(1.0, 100));
    let folder = tempfile::tempdir().expect("a folder");
    let second = folder.path().join("slow.mcap");
    let mut recorder = Recorder::create(&second, about()).expect("a new file");
    let slow = |_: f64| std::thread::sleep(Duration::from_millis(1_100));
    simulation(1.0, 100).record(&mut recorder, &AtomicBool::new(false), &mut { slow }).expect("runs");
    recorder.finish().expect("finishes");
    assert!(std::fs::read(first).expect("reads") == std::fs::read(second).expect("reads"));
}

#[test]
fn at_one_kilohertz_telemetry_alone_is_compared() {
    let (_folder, path) = recorded(&simulation(3.0, 1000));
    let frames = Recording::read(&path).expect("reads").telemetry;
    let checked = replay::telemetry::check(&frames).expect("the same");
    assert!(checked.factors > 2_500 && checked.leans > 2_500, "{checked:?}");
    assert!(checked.worst_lean_rad < 0.000_5, "{checked:?}");

    // From the middle on, as a recording of a running robot begins.
    let later = replay::telemetry::check(&frames[1_600..]).expect("the same");
    assert!(later.leans > 1_200, "{later:?}");

    let mut changed = frames.clone();
    changed[2_000].factor.0 += 1;
    assert_eq!(replay::telemetry::check(&changed).expect_err("another Factor").tick, 2_001);
    let mut changed = frames;
    changed[2_000].lean[0].0 += 200;
    let found = replay::telemetry::check(&changed).expect_err("3 mrad off");
    assert_eq!(found.tick, 2_001, "{found}");
}

#[test]
fn slower_telemetry_is_not_compared_and_says_so() {
    let (_folder, path) = recorded(&simulation(1.0, 100));
    let frames = Recording::read(&path).expect("reads").telemetry;
    let checked = replay::telemetry::check(&frames).expect("nothing to differ");
    assert_eq!((checked.factors, checked.leans), (0, 0));
    assert!(checked.to_string().contains("not compared: Factor and lean"), "{checked}");
}

/// The simulated robot on a serial port, in real time, until told to stop.
fn on_a_port(mut near: TTYPort, stop: Arc<AtomicBool>) {
    let Simulation { config, episode, .. } = simulation(60.0, 1000);
    let default = sarah_firmware::default_params();
    let mut robot = Sil::new(&config, default, default, &episode).expect("starts");
    let began = Instant::now();
    let mut bytes = [0; 256];
    while !stop.load(Ordering::Relaxed) {
        if near.bytes_to_read().is_ok_and(|waiting| waiting > 0) {
            let count = near.read(&mut bytes).unwrap_or(0);
            robot.host_write(&bytes[..count]);
        }
        robot.run_until(began.elapsed().as_micros() as u64).unwrap();
        match near.write_all(&robot.host_read()) {
            // Nobody reads fast enough: a serial line loses it.
            Err(error) if error.kind() == ErrorKind::TimedOut => {}
            written => written.expect("the other side is open"),
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_robot_on_a_port_is_recorded_and_its_telemetry_replayed() {
    let (near, far) = TTYPort::pair().expect("a pseudo-terminal");
    let target = Target::Path(far.name().expect("has a path"));
    drop(far);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("port.mcap");
    let listening = Listening { target, rate_hz: Some(1000), seconds: Some(2.0) };
    let link = listening.open().expect("opens");
    // Only now: a pseudo-terminal whose other side nobody has opened takes nothing.
    let stop = Arc::new(AtomicBool::new(false));
    let robot = std::thread::spawn({
        let stop = stop.clone();
        move || on_a_port(near, stop)
    });
    let mut recorder = Recorder::create(&path, About::now(link.now_us())).expect("a new file");
    let ended = listening.record(&link, &mut recorder, &AtomicBool::new(false), &mut |_| {}).expect("records");
    recorder.finish().expect("finishes");
    stop.store(true, Ordering::Relaxed);
    robot.join().expect("ran");
    drop(link);

    assert!(ended.up && ended.frames > 200, "{ended:?}");
    let replayed = replay(&path, &mut |_| {}).expect("the same");
    assert_eq!((replayed.control, replayed.complete), (None, true));
    assert_eq!(replayed.telemetry.frames, ended.frames);
    let text = replayed.to_string();
    assert!(text.contains("of a robot on a serial port only its telemetry is recorded"), "{text}");
    let bytes = std::fs::read(&path).expect("reads");
    let params = MessageStream::new(&bytes).expect("an MCAP file").flatten().filter(|m| m.channel.topic == "/params");
    assert!(params.count() >= 2, "the stored and the applied set were asked for");
}

#[test]
fn an_existing_file_is_refused_and_stays_as_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("precious.mcap");
    std::fs::write(&path, "precious").expect("writes");
    let refused = Recorder::create(&path, about()).err().expect("refused");
    assert!(matches!(refused, RecordingError::Exists(_)), "{refused}");
    assert!(refused.to_string().contains("--out"), "{refused}");
    assert_eq!(std::fs::read(&path).expect("reads"), b"precious");
}

#[test]
fn a_folder_nobody_may_write_to_is_a_clear_error() {
    let refused = Recorder::create(Path::new("/proc/nowhere/a.mcap"), about()).err().expect("refused");
    assert!(!refused.to_string().contains('\n') && refused.to_string().contains("/proc/nowhere"), "{refused}");
}

#[test]
fn a_full_disk_is_a_clear_error() {
    let full: File = OpenOptions::new().write(true).open("/dev/full").expect("Linux has one");
    let path = Path::new("/dev/full");
    let outcome = Recorder::over(path, full, about()).and_then(|mut recorder| {
        simulation(3.0, 100).record(&mut recorder, &AtomicBool::new(false), &mut |_| {})?;
        recorder.finish()
    });
    let error = outcome.expect_err("no space").to_string();
    assert!(error.contains("cannot write /dev/full") && error.contains("free some space"), "{error}");
    assert!(!error.contains('\n'), "{error}");
}

#[test]
fn what_is_no_recording_of_this_build_is_refused_by_name() {
    let (folder, path) = recorded(&simulation(0.2, 100));
    let ours = recorder::schema_text();
    let mut bytes = std::fs::read(&path).expect("reads");
    // In the first record, before any chunk with its check sum.
    let at = bytes.windows(ours.len()).position(|window| window == ours.as_bytes()).expect("stands in the file");
    bytes[at + 2..at + 10].copy_from_slice(b"00000001");
    let other = folder.path().join("other.mcap");
    std::fs::write(&other, bytes).expect("writes");
    let refused = Recording::read(&other).expect_err("another schema");
    assert!(matches!(&refused, RecordingError::Schema { recorded, .. } if recorded == "0x00000001"), "{refused}");

    for (name, content) in [("empty", &b""[..]), ("text", b"no recording"), ("zeros", &[0; 4096])] {
        let path = folder.path().join(name);
        std::fs::write(&path, content).expect("writes");
        assert!(matches!(Recording::read(&path), Err(RecordingError::Unfit { .. })), "{name}");
    }
}

#[test]
fn the_index_lets_tools_find_every_topic_without_reading_all() {
    let (_folder, path) = recorded(&simulation(2.0, 100));
    let bytes = std::fs::read(&path).expect("reads");
    let summary = mcap::Summary::read(&bytes).expect("reads").expect("has a summary");
    let stats = summary.stats.expect("has statistics");
    assert!(summary.chunk_indexes.len() >= 2, "one chunk a second");
    let read = MessageStream::new_with_options(&bytes, Options::IgnoreEndMagic.into()).expect("an MCAP file").count();
    assert_eq!(stats.message_count, read as u64);
}
