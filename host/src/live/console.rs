//! What the operator types while a robot is trained: one word a line.

use std::io::{BufRead, IsTerminal};
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
    /// What may be typed?
    Help,
    /// A keyboard is there no more: nobody can say stop.
    Gone,
}

/// What may be typed.
pub const HELP: &str = "type a + Enter to arm, Enter alone to stop at once, c to clear the stop, q to end";

impl Word {
    /// The word of a line. What is no word is most likely a hand that fell on the keyboard: a stop.
    pub fn of(line: &str) -> Word {
        match line.trim() {
            "a" | "arm" => Word::Arm,
            "c" | "clear" => Word::Clear,
            "q" | "quit" => Word::Quit,
            "?" | "h" | "help" => Word::Help,
            _ => Word::Stop,
        }
    }
}

/// Listens to the standard input from now on.
pub fn listen() -> Receiver<Word> {
    let (said, words) = channel();
    std::thread::spawn(move || {
        let mut input = std::io::stdin().lock();
        let mut line = vec![];
        // Bytes, not text: a stop must get through whatever was typed.
        while input.read_until(b'\n', &mut line).is_ok_and(|count| count > 0) {
            if said.send(Word::of(&String::from_utf8_lossy(&line))).is_err() {
                return;
            }
            line.clear();
        }
        if std::io::stdin().is_terminal() {
            // Nobody listens if the run is over.
            let _ = said.send(Word::Gone);
        }
    });
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anything_pressed_in_a_hurry_stops() {
        for line in ["", "s", "stop", " s ", "asdf", "aa", "\u{fffd}\u{fffd}", "arm now"] {
            assert_eq!(Word::of(line), Word::Stop, "{line:?}");
        }
        for (line, word) in [("a", Word::Arm), ("c\r\n", Word::Clear), ("q", Word::Quit), ("?", Word::Help)] {
            assert_eq!(Word::of(line), word);
        }
    }
}
