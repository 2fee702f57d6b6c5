//! What the operator types while a robot is trained: one word a line.

use std::io::BufRead;
use std::sync::mpsc::{Receiver, channel};

/// A word.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Word {
    /// Allow motion.
    Arm,
    /// Emergency stop.
    Stop,
    /// Unlatch the emergency stop.
    Clear,
    /// Save and end; the robot balances on.
    Quit,
}

/// What may be typed.
pub const HELP: &str = "type a + Enter to arm, s to stop at once, c to clear the stop, q to end";

impl Word {
    /// The word of a line. An empty line while something moves is most likely a hand that fell on the keyboard: a stop.
    pub fn of(line: &str) -> Option<Word> {
        match line.trim() {
            "a" | "arm" => Some(Word::Arm),
            "" | "s" | "stop" => Some(Word::Stop),
            "c" | "clear" => Some(Word::Clear),
            "q" | "quit" => Some(Word::Quit),
            _ => None,
        }
    }
}

/// Listens to the standard input from now on. Lines that are no word come as `None`.
pub fn listen() -> Receiver<Option<Word>> {
    let (said, words) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines() {
            let Ok(line) = line else { break };
            if said.send(Word::of(&line)).is_err() {
                break;
            }
        }
    });
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anything_pressed_in_a_hurry_stops() {
        for line in ["", "s", "stop", " s "] {
            assert_eq!(Word::of(line), Some(Word::Stop), "{line:?}");
        }
        assert_eq!(Word::of("a"), Some(Word::Arm));
        assert_eq!(Word::of("arm now"), None);
    }
}
