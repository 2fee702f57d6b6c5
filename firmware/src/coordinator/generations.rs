//! Parameter generations: a whole set in all three nodes from one cycle on, or in none.
//!
//! ```text
//!          stage           3 × Staged          commit              Gait names it, 3 × Status run it
//!   free ─────────► Staging ─────────► Staged ─────────► Activating ─────────► applied, free
//!                      │ refused, 0.5 s                      │ a node stays behind 0.3 s
//!                      └──────────► free, nothing changed    └────► split: the set before is staged anew
//! ```
//!
//! The coordinator stages sets of its own as well (stored set at boot and after host silence, the applied set for a
//! node that restarted): these commit themselves and are exempt from the rate-of-change limit.

use sarah_protocol::bus::{Gait, Message, NodeId, Stage, Staged, Status};
use sarah_protocol::host::{AckState, Refusal};
use sarah_protocol::newer;
use sarah_protocol::params::{ParamError, ParamSet, RawParams};

use super::age::Age;
use super::nodes::Nodes;

/// `Stage` and `Activate` are repeated this often, µs.
const RETRY_US: u32 = 20_000;
/// Staging ends without an answer of all nodes after this, µs.
const STAGING_US: u32 = 500_000;
/// No cycle lasts this long, µs: an activation that still waits is a fault.
const ACTIVATION_US: u32 = 5_000_000;
/// All nodes follow the knee within this, µs: three status messages and some.
const SPLIT_US: u32 = 300_000;
/// Pause before the coordinator tries a set of its own again, µs.
const AGAIN_US: u32 = 200_000;

/// Who asked.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Request {
    /// Its session.
    pub session: u16,
    /// Its sequence number.
    pub sequence: u16,
}

/// A set and its number.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Generation {
    /// Number; wraps.
    pub number: u32,
    /// Set.
    pub params: ParamSet,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Phase {
    Staging { answered: [bool; 3] },
    Staged,
    Activating { named: Option<u32>, late: bool },
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Slot {
    set: Generation,
    /// `None`: the coordinator's own.
    request: Option<Request>,
    /// A host's set, be it that the coordinator stages it again.
    of_host: bool,
    phase: Phase,
    in_phase: Age,
    retry: Age,
}

/// What became of a staging.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Outcome {
    /// All nodes hold it.
    Staged,
    /// All nodes run it since this cycle.
    Applied {
        /// Cycle number.
        cycle: u32,
    },
    /// A node refused it; nothing changed.
    Refused(NodeId, ParamError),
    /// A node did not answer; nothing changed.
    Silent,
    /// The knee does not get to a boundary.
    Late,
    /// This node stayed behind.
    Split(NodeId),
    /// The coordinator begins to stage a set of its own.
    Restaging,
}

/// An outcome, whose it is and who waits for it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct News {
    /// Generation number.
    pub generation: u32,
    /// Who asked, if a host did.
    pub request: Option<Request>,
    /// What happened.
    pub outcome: Outcome,
}

/// The generations the robot knows.
#[derive(Clone, Debug)]
pub struct Generations {
    applied: Generation,
    applied_by_host: bool,
    applied_cycle: u32,
    applied_age: Age,
    newest: u32,
    stored: ParamSet,
    slot: Option<Slot>,
    /// A set that the coordinator stages itself as soon as the slot is free, and whether it is a host's.
    wanted: Option<(ParamSet, bool)>,
    pause: Age,
    apart: Age,
}

impl Generations {
    /// The nodes run `default` as generation 0; `stored` becomes generation 1 if it differs.
    pub fn new(default: ParamSet, stored: ParamSet) -> Self {
        Generations {
            applied: Generation { number: 0, params: default },
            applied_by_host: false,
            applied_cycle: 0,
            applied_age: Age::default(),
            newest: 0,
            stored,
            slot: None,
            wanted: (stored != default).then_some((stored, false)),
            pause: Age::NEVER,
            apart: Age::default(),
        }
    }

    /// In force.
    pub fn applied(&self) -> &Generation {
        &self.applied
    }

    /// In force since.
    pub fn applied_age(&self) -> Age {
        self.applied_age
    }

    /// A host's set is in force, and it is not the stored one.
    pub fn on_host_set(&self) -> bool {
        self.applied_by_host && self.applied.params != self.stored
    }

    /// Held by all nodes, waiting for a commit or a boundary.
    pub fn staged(&self) -> Option<&Generation> {
        self.slot.as_ref().filter(|slot| !matches!(slot.phase, Phase::Staging { .. })).map(|slot| &slot.set)
    }

    /// In non-volatile memory.
    pub fn stored(&self) -> &ParamSet {
        &self.stored
    }

    /// The shell has written this set.
    pub fn set_stored(&mut self, params: ParamSet) {
        self.stored = params;
    }

    /// No set of the coordinator's own is due or under way, and all nodes run the applied generation.
    pub fn settled(&self, nodes: &Nodes) -> bool {
        self.wanted.is_none()
            && self.slot.as_ref().is_none_or(|slot| slot.request.is_some())
            && nodes.without(self.applied.number).is_none()
    }

    /// A host's set: checks it and starts staging.
    pub fn stage(&mut self, number: u32, params: RawParams, request: Request) -> Result<AckState, Refusal> {
        if let Some(slot) = self.slot.as_mut().filter(|slot| slot.set.number == number && slot.request.is_some()) {
            if *slot.set.params.values() != params {
                return Err(Refusal::Duplicate(number));
            }
            slot.request = Some(request);
            return Ok(match slot.phase {
                Phase::Staged => AckState::Staged { generation: number },
                _ => AckState::Received,
            });
        }
        if self.applied.number == number && self.applied_by_host && *self.applied.params.values() == params {
            return Ok(AckState::Applied { generation: number, cycle: self.applied_cycle });
        }
        if !newer(number, self.newest) {
            return Err(Refusal::Stale { newest: self.newest });
        }
        let busy = |slot: &Slot| slot.request.is_none() || matches!(slot.phase, Phase::Activating { .. });
        if let Some(slot) = self.slot.as_ref().filter(|slot| busy(slot)) {
            return Err(Refusal::Busy(slot.set.number));
        }
        let set = ParamSet::new(params).map_err(Refusal::Params)?;
        self.applied.params.check_change(&set).map_err(Refusal::Params)?;
        self.begin(number, set, Some(request), true);
        Ok(AckState::Received)
    }

    /// A host commits what it staged.
    pub fn commit(&mut self, number: u32, request: Request) -> Result<AckState, Refusal> {
        if let Some(slot) = self.slot.as_mut().filter(|slot| slot.set.number == number && slot.request.is_some()) {
            match slot.phase {
                Phase::Staging { .. } => return Err(Refusal::NotStaged(number)),
                Phase::Staged => slot.enter(Phase::Activating { named: None, late: false }),
                Phase::Activating { .. } => {}
            }
            slot.request = Some(request);
            return Ok(AckState::Received);
        }
        if self.applied.number == number {
            return Ok(AckState::Applied { generation: number, cycle: self.applied_cycle });
        }
        Err(if newer(number, self.newest) {
            Refusal::NotStaged(number)
        } else {
            Refusal::Stale { newest: self.newest }
        })
    }

    /// Back to the stored set at the next chance. False while the coordinator stages something else.
    pub fn fall_back(&mut self) -> bool {
        let free = self.wanted.is_none() && self.slot.as_ref().is_none_or(|slot| slot.request.is_some());
        if free {
            self.wanted = Some((self.stored, false));
        }
        free
    }

    /// A node restarted: whatever was being staged is gone from it, and so is the applied set.
    pub fn node_restarted(&mut self) -> Option<News> {
        let news = self.slot.take().map(|slot| slot.news(Outcome::Silent));
        self.recover();
        news
    }

    /// Empties the slot; a set of the coordinator's own is tried again later, under a new number.
    fn give_up(&mut self) {
        if let Some(slot) = self.slot.take().filter(|slot| slot.request.is_none()) {
            self.wanted = Some((slot.set.params, slot.of_host));
        }
        self.pause.reset();
    }

    fn recover(&mut self) {
        self.slot = None;
        let built_in = self.applied.number == 0;
        self.wanted = Some(if built_in { (self.stored, false) } else { (self.applied.params, self.applied_by_host) });
    }

    fn begin(&mut self, number: u32, params: ParamSet, request: Option<Request>, of_host: bool) {
        self.newest = number;
        self.slot = Some(Slot {
            set: Generation { number, params },
            request,
            of_host,
            phase: Phase::Staging { answered: [false; 3] },
            in_phase: Age::default(),
            retry: Age::NEVER,
        });
    }

    /// A node answered.
    pub fn on_staged(&mut self, node: NodeId, staged: &Staged) -> Option<News> {
        let slot = self.slot.as_mut().filter(|slot| slot.set.number == staged.generation)?;
        let Phase::Staging { answered } = &mut slot.phase else { return None };
        if let Err(error) = staged.result {
            let news = slot.news(Outcome::Refused(node, error));
            self.give_up();
            return Some(news);
        }
        *answered.get_mut(node as usize)? = true;
        if *answered != [true; 3] {
            return None;
        }
        let own = slot.request.is_none();
        slot.enter(if own { Phase::Activating { named: None, late: false } } else { Phase::Staged });
        Some(slot.news(Outcome::Staged))
    }

    /// The knee named the generation in force.
    pub fn on_gait(&mut self, gait: &Gait) {
        self.named(gait.generation, gait.cycle);
    }

    fn named(&mut self, number: u32, at_cycle: u32) {
        if let Some(slot) = self.slot.as_mut().filter(|slot| slot.set.number == number)
            && let Phase::Activating { named: None, .. } = slot.phase
        {
            slot.enter(Phase::Activating { named: Some(at_cycle), late: false });
        }
    }

    /// A node said what it runs; `nodes` has it already.
    pub fn on_status(&mut self, node: NodeId, status: &Status, nodes: &Nodes) -> Option<News> {
        for seen in [Some(status.applied), status.staged].into_iter().flatten() {
            if newer(seen, self.newest) {
                self.newest = seen;
            }
        }
        if node == NodeId::Knee {
            // In case the frame with the flag was lost.
            self.named(status.applied, status.cycle);
        }
        let slot = self.slot.as_ref()?;
        let Phase::Activating { named: Some(cycle), .. } = slot.phase else { return None };
        if nodes.without(slot.set.number).is_some() {
            return None;
        }
        let news = slot.news(Outcome::Applied { cycle });
        self.applied = slot.set;
        self.applied_by_host = slot.of_host;
        self.applied_cycle = cycle;
        self.applied_age.reset();
        self.apart.reset();
        self.slot = None;
        Some(news)
    }

    /// `dt_us` passed: time-outs, and the message that is due.
    pub fn tick(&mut self, dt_us: u32, nodes: &Nodes) -> (Option<News>, Option<Message>) {
        self.applied_age.advance(dt_us);
        self.pause.advance(dt_us);
        let news = match &mut self.slot {
            Some(slot) => {
                slot.in_phase.advance(dt_us);
                slot.retry.advance(dt_us);
                self.apart.reset();
                self.slot_timeout(nodes)
            }
            None => self.idle(dt_us, nodes),
        };
        (news, self.slot.as_mut().and_then(Slot::due))
    }

    fn slot_timeout(&mut self, nodes: &Nodes) -> Option<News> {
        let slot = self.slot.as_mut()?;
        match &mut slot.phase {
            Phase::Staging { .. } if slot.in_phase.reached(STAGING_US) => {
                let news = slot.news(Outcome::Silent);
                self.give_up();
                Some(news)
            }
            // The coordinator's own set has precedence over one that only waits for its commit.
            Phase::Staged if self.wanted.is_some() => {
                let news = slot.news(Outcome::Silent);
                self.slot = None;
                Some(news)
            }
            Phase::Activating { named: Some(_), .. } if slot.in_phase.reached(SPLIT_US) => {
                let behind = nodes.without(slot.set.number)?;
                let news = slot.news(Outcome::Split(behind));
                self.recover();
                Some(news)
            }
            Phase::Activating { named: None, late: late @ false } if slot.in_phase.reached(ACTIVATION_US) => {
                *late = true;
                Some(slot.news(Outcome::Late))
            }
            _ => None,
        }
    }

    fn idle(&mut self, dt_us: u32, nodes: &Nodes) -> Option<News> {
        if nodes.missing().is_some() {
            self.apart.reset();
            return None;
        }
        if let Some((params, of_host)) = self.wanted {
            if !self.pause.due(AGAIN_US) {
                return None;
            }
            self.wanted = None;
            self.begin(self.newest.wrapping_add(1), params, None, of_host);
            return self.slot.as_ref().map(|slot| slot.news(Outcome::Restaging));
        }
        let behind = nodes.without(self.applied.number);
        self.apart.advance(dt_us);
        if behind.is_none() {
            self.apart.reset();
        }
        let behind = behind.filter(|_| self.apart.reached(SPLIT_US))?;
        self.recover();
        Some(News { generation: self.applied.number, request: None, outcome: Outcome::Split(behind) })
    }
}

impl Slot {
    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.in_phase.reset();
        self.retry = Age::NEVER;
    }

    fn news(&self, outcome: Outcome) -> News {
        News { generation: self.set.number, request: self.request, outcome }
    }

    fn due(&mut self) -> Option<Message> {
        let message = match self.phase {
            Phase::Staging { .. } => {
                Message::Stage(Stage { generation: self.set.number, params: *self.set.params.values() })
            }
            Phase::Staged => return None,
            Phase::Activating { .. } => Message::Activate(self.set.number),
        };
        self.retry.due(RETRY_US).then_some(message)
    }
}
