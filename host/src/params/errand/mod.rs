//! One errand to a robot: read its sets, change the one in force, or keep it over power cycles.
//!
//! ```text
//!   open ──► read all three ──► done
//!                  ├─ change ──► sent ──► staged ──► applied at cycle n ──► (again, if one generation may not go so far)
//!                  └─ keep   ──► sent ──► stored
//! ```
//!
//! [`Errand`] is pure: what the link heard and time in, asks and words out. [`run`] is the loop around it.

mod error;
#[cfg(test)]
mod tests;

use std::time::Duration;

use sarah_protocol::host::{Command, ParamsReport, Refusal, Which};
use sarah_protocol::params::ParamSet;
use sarah_protocol::session::News;

pub use error::RobotError;

use crate::link::live::{Ask, Heard, Link, Role, What};

/// The robot greets and the claim is granted within this, µs. A claim lapses after 2 s.
const OPEN_US: u64 = 4_000_000;
/// The three sets are read within this, µs.
const READ_US: u64 = 3_000_000;
/// A generation is in force within this, µs: the robot itself gives up after 5 s.
const APPLY_US: u64 = 8_000_000;
/// A set is written within this, µs.
const KEEP_US: u64 = 5_000_000;

/// A set of the robot.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Known {
    /// Its generation; 0 for the stored set.
    pub generation: u32,
    /// The set.
    pub set: ParamSet,
}

/// The robot's three sets; `None` is one that is not there.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct RobotSets {
    /// In force.
    pub applied: Option<Known>,
    /// Held by the nodes, not in force.
    pub staged: Option<Known>,
    /// In memory.
    pub stored: Option<Known>,
}

impl RobotSets {
    /// All three.
    pub fn all(&self) -> [(Which, &Option<Known>); 3] {
        [(Which::Applied, &self.applied), (Which::Staged, &self.staged), (Which::Stored, &self.stored)]
    }

    /// One of them, or that it is not there.
    pub fn get(&self, which: Which) -> Result<ParamSet, RobotError> {
        let known = match which {
            Which::Applied => self.applied,
            Which::Staged => self.staged,
            Which::Stored => self.stored,
        };
        known.map(|known| known.set).ok_or(RobotError::NoSet(crate::params::source::name(which)))
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Stage {
    Opening,
    Reading { left: [bool; 3] },
    Read,
    Changing { goal: ParamSet, now: ParamSet, staged: Option<u32> },
    Keeping,
    Done,
}

/// An errand under way.
#[derive(Clone, Debug)]
pub struct Errand {
    role: Role,
    stage: Stage,
    since_us: u64,
    sets: RobotSets,
    asks: Vec<Ask>,
    said: Vec<String>,
    other: Option<u16>,
}

impl Errand {
    /// Opens the conversation and reads the three sets.
    pub fn read(role: Role) -> Errand {
        Errand {
            role,
            stage: Stage::Opening,
            since_us: 0,
            sets: RobotSets::default(),
            asks: vec![],
            said: vec![],
            other: None,
        }
    }

    /// The sets; whole once reading is done.
    pub fn sets(&self) -> &RobotSets {
        &self.sets
    }

    /// Goes on to change the set in force. False if it is that set already.
    pub fn change(&mut self, now_us: u64, goal: ParamSet) -> Result<bool, RobotError> {
        let now = self.sets.get(Which::Applied)?;
        if now == goal {
            self.stage = Stage::Done;
            return Ok(false);
        }
        if now.towards(&goal) != goal {
            self.said.push("further than one generation may go: two generations".into());
        }
        self.said.push("sent".into());
        self.asks.push(Ask::Params(goal));
        self.enter(now_us, Stage::Changing { goal, now, staged: None });
        Ok(true)
    }

    /// Goes on to keep the set in force over power cycles.
    pub fn keep(&mut self, now_us: u64) {
        self.asks.push(Ask::Persist);
        self.enter(now_us, Stage::Keeping);
    }

    fn enter(&mut self, now_us: u64, stage: Stage) {
        self.since_us = now_us;
        self.stage = stage;
    }

    /// What to ask now.
    pub fn asks(&mut self) -> Vec<Ask> {
        std::mem::take(&mut self.asks)
    }

    /// What to tell the user now.
    pub fn said(&mut self) -> Vec<String> {
        std::mem::take(&mut self.said)
    }

    /// Nothing is left to do until the next wish.
    pub fn idle(&self) -> bool {
        matches!(self.stage, Stage::Read | Stage::Done)
    }

    /// Takes in what the link heard.
    pub fn on(&mut self, heard: &Heard) -> Result<(), RobotError> {
        match &heard.what {
            What::Up { .. } => Ok(()),
            What::Down { why } => Err(RobotError::Lost(why.clone())),
            What::NotNow { why, .. } => Err(RobotError::NotNow(*why)),
            What::News(news) => self.on_news(heard.at_us, news),
        }
    }

    fn on_news(&mut self, at_us: u64, news: &News) -> Result<(), RobotError> {
        match *news {
            News::Failed(error) => return Err(error.into()),
            News::Rebooted => return Err(RobotError::Rebooted),
            // An observer needs no claim.
            News::Connected(_) if self.role == Role::Observer => self.opened(at_us),
            News::Claimed => self.opened(at_us),
            News::Refused(Command::Claim, Refusal::Claimed { by }) => self.other = Some(by),
            News::Refused(Command::Stage { .. } | Command::Commit { .. }, why) => {
                return Err(RobotError::Refused { what: "the set", why });
            }
            News::Refused(Command::Persist { .. }, why) => {
                return Err(RobotError::Refused { what: "to store the set", why });
            }
            News::Params(report) => return self.learn(&report),
            News::Staged(generation) => {
                if let Stage::Changing { staged, .. } = &mut self.stage {
                    *staged = Some(generation);
                    self.said.push(format!("generation {generation} staged: all three nodes hold it"));
                }
            }
            News::Applied { generation, cycle } => self.applied(at_us, generation, cycle),
            News::Persisted(generation) if self.stage == Stage::Keeping => {
                self.said.push(format!("generation {generation} stored: it is in force after power cycles too"));
                self.stage = Stage::Done;
            }
            _ => {}
        }
        Ok(())
    }

    fn opened(&mut self, at_us: u64) {
        if self.stage == Stage::Opening {
            self.asks.extend([Which::Applied, Which::Staged, Which::Stored].map(Ask::Get));
            self.enter(at_us, Stage::Reading { left: [true; 3] });
        }
    }

    fn learn(&mut self, report: &ParamsReport) -> Result<(), RobotError> {
        let set = report.params.map(ParamSet::new).transpose().map_err(RobotError::Impossible)?;
        let known = set.map(|set| Known { generation: report.generation, set });
        let (slot, index) = match report.which {
            Which::Applied => (&mut self.sets.applied, 0),
            Which::Staged => (&mut self.sets.staged, 1),
            Which::Stored => (&mut self.sets.stored, 2),
        };
        *slot = known;
        if let Stage::Reading { left } = &mut self.stage {
            left[index] = false;
            if *left == [false; 3] {
                self.stage = Stage::Read;
            }
        }
        Ok(())
    }

    fn applied(&mut self, at_us: u64, generation: u32, cycle: u32) {
        let Stage::Changing { goal, now, .. } = self.stage else { return };
        let now = now.towards(&goal);
        self.said.push(format!("generation {generation} applied from cycle {cycle} on"));
        self.sets.applied = Some(Known { generation, set: now });
        match now == goal {
            true => self.stage = Stage::Done,
            // The link sends the rest by itself.
            false => self.enter(at_us, Stage::Changing { goal, now, staged: None }),
        }
    }

    /// What does not come in time.
    pub fn at(&self, now_us: u64) -> Result<(), RobotError> {
        let (patience_us, error) = match (self.stage, self.other) {
            (Stage::Opening, Some(by)) => (OPEN_US, RobotError::OtherWriter { by }),
            (Stage::Opening, None) => (OPEN_US, RobotError::Silent),
            (Stage::Reading { .. }, _) => (READ_US, RobotError::NotRead),
            (Stage::Changing { staged: None, .. }, _) => (APPLY_US, RobotError::NotStaged),
            (Stage::Changing { staged: Some(generation), .. }, _) => (APPLY_US, RobotError::NoBoundary(generation)),
            (Stage::Keeping, _) => (KEEP_US, RobotError::NotKept),
            (Stage::Read | Stage::Done, _) => return Ok(()),
        };
        if now_us.saturating_sub(self.since_us) > patience_us { Err(error) } else { Ok(()) }
    }
}

/// Runs an errand until nothing is left to do. `say` hears how far it is.
pub fn run(link: &Link, errand: &mut Errand, say: &mut dyn FnMut(&str)) -> Result<(), RobotError> {
    loop {
        errand.asks().into_iter().for_each(|ask| link.ask(ask));
        errand.said().iter().for_each(|words| say(words));
        if errand.idle() {
            return Ok(());
        }
        if let Some(heard) = link.next(Duration::from_millis(50)) {
            errand.on(&heard)?;
        }
        errand.at(link.now_us())?;
    }
}
