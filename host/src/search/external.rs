//! A search that somebody else wrote: a program that proposes, line by line, on its standard input and output.
//!
//! ```text
//!  to it    {"start": [0.1, -0.3], "episodes": 60, "seed": 11}     first; every number of a point lies in [-1, 1]
//!  from it  [0.2, -0.1]                                            the next point to try
//!  to it    {"reward": 0.31}                                       what one episode there earned; it answers with the next
//!  to it    {"recommend": true}                                    it answers with the point to keep
//! ```
//!
//! It must propose the same points for the same seed and rewards: a run that was cut off tells it all rewards again.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use serde::Serialize;

use super::{Search, SearchError};

/// A program that has not answered by then never will.
const ANSWERS_WITHIN: Duration = Duration::from_secs(120);

/// A search in another process, which ends with it.
pub struct ExternalSearch {
    name: String,
    process: Child,
    to: Option<ChildStdin>,
    /// Its lines, from a thread that ends with its output.
    from: Receiver<std::io::Result<String>>,
    answers_within: Duration,
    dimensions: usize,
    next: Vec<f32>,
}

#[derive(Serialize)]
struct Begin<'a> {
    start: &'a [f32],
    episodes: usize,
    seed: u64,
}

#[derive(Serialize)]
struct Told {
    reward: f32,
}

#[derive(Serialize)]
struct Recommend {
    recommend: bool,
}

impl ExternalSearch {
    /// Starts `command` (a program and its arguments) and tells it what was found so far.
    pub fn new(
        command: &[String],
        start: &[f32],
        episodes: usize,
        seed: u64,
        rewards: &[f32],
    ) -> Result<ExternalSearch, SearchError> {
        ExternalSearch::patient(command, start, episodes, seed, rewards, ANSWERS_WITHIN)
    }

    fn patient(
        command: &[String],
        start: &[f32],
        episodes: usize,
        seed: u64,
        rewards: &[f32],
        answers_within: Duration,
    ) -> Result<ExternalSearch, SearchError> {
        let [program, arguments @ ..] = command else { return Err(SearchError::NoCommand) };
        let name = command.join(" ");
        let failed = |source| SearchError::Start { command: name.clone(), source };
        let mut process = Command::new(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(failed)?;
        let (to, from) = (process.stdin.take(), process.stdout.take());
        let lines = BufReader::new(from.ok_or_else(|| failed(std::io::ErrorKind::BrokenPipe.into()))?).lines();
        let (says, from) = channel();
        std::thread::spawn(move || {
            for line in lines {
                if says.send(line).is_err() {
                    break;
                }
            }
        });
        let dimensions = start.len();
        let mut search =
            ExternalSearch { name: name.clone(), process, to, from, answers_within, dimensions, next: vec![] };
        search.next = search.question(&Begin { start, episodes, seed })?;
        for reward in rewards {
            search.tell(*reward)?;
        }
        Ok(search)
    }

    fn question<T: Serialize>(&mut self, question: &T) -> Result<Vec<f32>, SearchError> {
        let lost = |source| SearchError::Lost { command: self.name.clone(), source };
        let mut line = serde_json::to_string(question).map_err(|error| lost(error.into()))?;
        line.push('\n');
        let to = self.to.as_mut().ok_or_else(|| lost(std::io::ErrorKind::BrokenPipe.into()))?;
        to.write_all(line.as_bytes()).and_then(|()| to.flush()).map_err(lost)?;
        let answer = match self.from.recv_timeout(self.answers_within) {
            Ok(line) => line.map_err(lost)?,
            Err(RecvTimeoutError::Disconnected) => return Err(lost(std::io::ErrorKind::UnexpectedEof.into())),
            Err(RecvTimeoutError::Timeout) => {
                return Err(SearchError::Silent { command: self.name.clone(), seconds: self.answers_within.as_secs() });
            }
        };
        let point: Option<Vec<f32>> = serde_json::from_str(&answer).ok();
        point
            .filter(|point| point.len() == self.dimensions && point.iter().all(|u| (-1.0..=1.0).contains(u)))
            .ok_or_else(|| SearchError::Answer {
                command: self.name.clone(),
                answer: answer.trim().chars().take(80).collect(),
                dimensions: self.dimensions,
            })
    }
}

impl Search for ExternalSearch {
    fn ask(&mut self) -> Result<Vec<f32>, SearchError> {
        Ok(self.next.clone())
    }

    fn tell(&mut self, reward: f32) -> Result<(), SearchError> {
        self.next = self.question(&Told { reward })?;
        Ok(())
    }

    fn recommend(&mut self) -> Result<Vec<f32>, SearchError> {
        self.question(&Recommend { recommend: true })
    }
}

impl Drop for ExternalSearch {
    fn drop(&mut self) {
        // The end of its input asks it to end; one that has not within a second is ended, so that none outlives the run.
        self.to = None;
        for _ in 0..100 {
            if matches!(self.process.try_wait(), Ok(Some(_)) | Err(_)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers every line with the next of `answers`.
    fn shell(answers: &[&str]) -> Vec<String> {
        let script: String = answers.iter().map(|answer| format!("read line; echo '{answer}'; ")).collect();
        ["sh", "-c", &script].map(String::from).to_vec()
    }

    #[test]
    fn it_hears_the_past_again_and_proposes_what_comes_next() {
        let command = shell(&["[0.1, 0.2]", "[0.3, 0.4]", "[0.5, 0.6]", "[-1, 1]"]);
        let mut search = ExternalSearch::new(&command, &[0.0, 0.0], 60, 1, &[0.7]).unwrap();
        assert_eq!(search.ask().unwrap(), [0.3, 0.4]);
        search.tell(0.9).unwrap();
        assert_eq!(search.ask().unwrap(), [0.5, 0.6]);
        assert_eq!(search.recommend().unwrap(), [-1.0, 1.0]);
    }

    #[test]
    fn programs_that_are_missing_silent_end_early_or_talk_nonsense_are_named() {
        let error = |command: &[String]| ExternalSearch::new(command, &[0.0], 60, 1, &[]).err().unwrap().to_string();
        assert!(error(&[]).contains("external"));
        assert!(error(&["/no/such/program".into()]).contains("/no/such/program"));
        assert!(error(&shell(&[])).contains("sh -c"));
        let patience = Duration::from_secs(1);
        let silent = ["sleep", "1000"].map(String::from);
        let error_of_silent = ExternalSearch::patient(&silent, &[0.0], 60, 1, &[], patience).err().unwrap().to_string();
        assert!(error_of_silent.contains("sleep 1000") && error_of_silent.contains("1 s"), "{error_of_silent}");
        for nonsense in ["hello", "[0.1, 0.2]", "[2.0]"] {
            assert!(error(&shell(&[nonsense])).contains(nonsense), "{nonsense}");
        }
    }
}
