//! A recording without an end, in files that are each whole.
//!
//! The next part is begun before the one before it is ended, so nothing that was heard falls between; where no next one
//! can be begun, the last is ended as it should be. No part is ever deleted.

use std::fs::File;
use std::io::{Seek, Write};
use std::path::{Path, PathBuf};

use super::error::RecordingError;
use super::recorder::Recorder;

/// Which part is to be begun.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Part {
    /// Its number, from 1.
    pub number: u32,
    /// When it begins, µs on the link's clock.
    pub begins_us: u64,
}

/// Begins a part.
pub type Begin<'a, W> = Box<dyn FnMut(Part) -> Result<Recorder<W>, RecordingError> + 'a>;

/// The parts of one recording.
pub struct Parts<'a, W: Write + Seek = File> {
    begin: Begin<'a, W>,
    every_us: u64,
    part: Part,
    recorder: Recorder<W>,
    /// In the parts before.
    telemetry: u64,
    messages: u64,
}

impl<'a, W: Write + Seek> Parts<'a, W> {
    /// Begins the first part at `now_us` on the link's clock, and another every `every_us`; without it there is only one.
    pub fn new(every_us: Option<u64>, now_us: u64, mut begin: Begin<'a, W>) -> Result<Parts<'a, W>, RecordingError> {
        let part = Part { number: 1, begins_us: now_us };
        let recorder = begin(part)?;
        Ok(Parts { begin, every_us: every_us.unwrap_or(u64::MAX), part, recorder, telemetry: 0, messages: 0 })
    }

    /// The part that is being written.
    pub fn recorder(&mut self) -> &mut Recorder<W> {
        &mut self.recorder
    }

    /// Begins the next part if it is time to; whether it did.
    pub fn turn(&mut self, now_us: u64) -> Result<bool, RecordingError> {
        if now_us.saturating_sub(self.part.begins_us) < self.every_us {
            return Ok(false);
        }
        let part = Part { number: self.part.number + 1, begins_us: now_us };
        let next = (self.begin)(part)?;
        let before = std::mem::replace(&mut self.recorder, next);
        self.part = part;
        self.telemetry += before.telemetry();
        self.messages += before.finish()?;
        Ok(true)
    }

    /// Telemetry frames so far, in all parts.
    pub fn telemetry(&self) -> u64 {
        self.telemetry + self.recorder.telemetry()
    }

    /// Ends the last part; the messages in all of them.
    pub fn finish(self) -> Result<u64, RecordingError> {
        Ok(self.messages + self.recorder.finish()?)
    }
}

/// The file of a part that begins at `time` (UTC): the one that was chosen, then its name with the time; or a name that
/// is the time. A name that nobody chose is one that is free: two recordings may begin in one second, and a clock that was
/// set back must not end one that goes on.
pub fn file_of(chosen: Option<&Path>, number: u32, time: &str) -> PathBuf {
    // Colons are not for file names everywhere.
    let time = time.replace(':', "-");
    let path = match chosen {
        None => Path::new("recordings").join(format!("{time}.mcap")),
        Some(path) if number == 1 => return path.to_path_buf(),
        Some(path) => named(path, &time),
    };
    let others = (2..u32::MAX).map(|count| named(&path, &count.to_string()));
    std::iter::once(path.clone()).chain(others).find(|path| !path.exists()).unwrap_or(path)
}

fn named(path: &Path, what: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map(|end| format!(".{}", end.to_string_lossy())).unwrap_or_default();
    path.with_file_name(format!("{stem}-{what}{extension}"))
}

#[cfg(test)]
mod tests {
    use std::cell::{Cell, RefCell};
    use std::io::{self, ErrorKind, SeekFrom};
    use std::rc::Rc;

    use sarah_protocol::session::News;
    use sarah_protocol::telemetry::Telemetry;

    use super::super::reader::Recording;
    use super::*;
    use crate::link::live::{Heard, What};
    use crate::recording::About;

    /// A file on a disk with so many bytes left.
    struct Limited {
        file: File,
        left: Rc<Cell<usize>>,
    }

    impl Write for Limited {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let count = bytes.len().min(self.left.get());
            if count == 0 && !bytes.is_empty() {
                return Err(ErrorKind::StorageFull.into());
            }
            self.left.set(self.left.get() - count);
            self.file.write(&bytes[..count])
        }

        fn flush(&mut self) -> io::Result<()> {
            self.file.flush()
        }
    }

    impl Seek for Limited {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.file.seek(to)
        }
    }

    /// Parts of two seconds, `1`, `2` and so on in `folder`, on a disk with `left` bytes.
    fn parts<'a>(folder: &'a Path, left: usize, begun: &'a RefCell<Vec<Part>>) -> Parts<'a, Limited> {
        let left = Rc::new(Cell::new(left));
        let begin = move |part: Part| {
            begun.borrow_mut().push(part);
            let path = folder.join(part.number.to_string());
            let file = Limited { file: File::create(&path).expect("creates"), left: left.clone() };
            let about = About { start_ns: 1_000_000_000_000, begins_us: part.begins_us, ..About::default() };
            Recorder::over(&path, file, about.with("part", part.number.to_string()))
        };
        Parts::new(Some(2_000_000), 0, Box::new(begin)).expect("begins")
    }

    /// Telemetry every 10 ms for `seconds`.
    fn hear(parts: &mut Parts<'_, Limited>, seconds: u64) -> Result<(), RecordingError> {
        for at_us in (10_000..seconds * 1_000_000).step_by(10_000) {
            parts.turn(at_us)?;
            let telemetry = Telemetry { time_us: at_us as u32, ..Telemetry::default() };
            parts.recorder().hear(&Heard { at_us, what: What::News(News::Telemetry(telemetry)) }, None)?;
        }
        Ok(())
    }

    #[test]
    fn every_part_is_whole_says_which_it_is_and_nothing_falls_between() {
        let folder = tempfile::tempdir().expect("a folder");
        let begun = RefCell::new(vec![]);
        let mut parts = parts(folder.path(), usize::MAX, &begun);
        hear(&mut parts, 5).expect("records");
        assert_eq!(parts.telemetry(), 499);
        let messages = parts.finish().expect("finishes");
        let begins_us: Vec<u64> = begun.borrow().iter().map(|part| part.begins_us).collect();
        assert_eq!(begins_us, [0, 2_000_000, 4_000_000]);
        let read = |number: u32| Recording::read(&folder.path().join(number.to_string())).expect("reads");
        let recordings = [1, 2, 3].map(read);
        let mut times_us = vec![];
        for (number, recording) in (1..).zip(&recordings) {
            assert!(recording.complete);
            assert_eq!(recording.about["part"], format!("{number}"));
            times_us.extend(recording.telemetry.iter().map(|frame| frame.time_us));
        }
        assert!(times_us.iter().copied().eq((10_000..5_000_000).step_by(10_000)), "each frame once, in order");
        assert_eq!(recordings.iter().map(|recording| recording.messages).sum::<u64>(), messages);
    }

    #[test]
    fn a_part_begins_at_its_own_time_and_not_when_the_first_did() {
        let folder = tempfile::tempdir().expect("a folder");
        let begun = RefCell::new(vec![]);
        let mut parts = parts(folder.path(), usize::MAX, &begun);
        hear(&mut parts, 3).expect("records");
        parts.finish().expect("finishes");
        let bytes = std::fs::read(folder.path().join("2")).expect("reads");
        let messages = mcap::MessageStream::new(&bytes).expect("an MCAP file");
        let first_ns = messages.map(|message| message.expect("whole").log_time).min();
        assert_eq!(first_ns, Some(1_002_000_000_000));
    }

    #[test]
    fn a_full_disk_is_a_clear_error_and_the_parts_so_far_are_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let begun = RefCell::new(vec![]);
        let mut whole = parts(folder.path(), usize::MAX, &begun);
        hear(&mut whole, 4).expect("records");
        whole.finish().expect("finishes");
        let size = |number: u32| folder.path().join(number.to_string()).metadata().expect("is there").len() as usize;
        // Full in the middle of the second part, at its index, and where a third would begin.
        for left in [size(1) + size(2) * 3 / 4, size(1) + size(2) - 100, size(1) + size(2) + 100] {
            let begun = RefCell::new(vec![]);
            let mut parts = parts(folder.path(), left, &begun);
            let error = hear(&mut parts, 5).expect_err("no space").to_string();
            // As `sarah record` does, which tells the first error.
            let _ = parts.finish();
            assert!(error.contains("cannot write") && error.contains("free some space"), "{error}");
            let read = |number: u32| Recording::read(&folder.path().join(number.to_string())).expect("reads");
            assert!(read(1).complete && read(1).telemetry.len() == 199, "{left}");
            assert!(read(2).telemetry.len() > 80, "{left}: {}", read(2).telemetry.len());
        }
    }

    #[test]
    fn without_a_time_there_is_one_part() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.mcap");
        let begin = |_| Recorder::create(&path, About::default());
        let mut parts = Parts::new(None, 5, Box::new(begin)).expect("begins");
        assert!(!parts.turn(u64::MAX - 1).expect("nothing to do"));
    }

    #[test]
    fn parts_are_named_by_their_time_and_after_the_file_that_was_chosen() {
        let time = "2031-02-03T04:05:06Z";
        let (folder, chosen) = (tempfile::tempdir().expect("a folder"), Path::new("out/walk.mcap"));
        assert_eq!(file_of(None, 1, time), Path::new("recordings/2031-02-03T04-05-06Z.mcap"));
        assert_eq!(file_of(None, 7, time), Path::new("recordings/2031-02-03T04-05-06Z.mcap"));
        assert_eq!(file_of(Some(chosen), 1, time), chosen);
        assert_eq!(file_of(Some(chosen), 2, time), Path::new("out/walk-2031-02-03T04-05-06Z.mcap"));
        let (chosen, next) = (folder.path().join("walk.mcap"), "walk-2031-02-03T04-05-06Z");
        for name in [format!("{next}.mcap"), format!("{next}-2.mcap"), format!("{next}-3.mcap")] {
            assert_eq!(file_of(Some(&chosen), 2, time), folder.path().join(&name));
            std::fs::write(folder.path().join(&name), "an older one").expect("writes");
        }
    }
}
