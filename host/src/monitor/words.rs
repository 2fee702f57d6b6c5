//! What the robot says in bits, in plain words, each with what to do about it.

use sarah_protocol::bus::{HaltReason, NodeId, limits};
use sarah_protocol::telemetry::{Event, ResetCause, faults};

/// Something to say and what to do about it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Advice {
    /// What is the matter.
    pub what: String,
    /// What to do.
    pub remedy: String,
}

impl Advice {
    /// Words for both.
    pub fn new(what: impl Into<String>, remedy: impl Into<String>) -> Advice {
        Advice { what: what.into(), remedy: remedy.into() }
    }
}

/// Name of a node.
pub fn node(id: NodeId) -> &'static str {
    match id {
        NodeId::Knee => "knee",
        NodeId::Hip => "hip",
        NodeId::Abductor => "abductor",
    }
}

/// Every set bit of [`sarah_protocol::telemetry::Telemetry::faults`], the causes before their consequence.
/// `halted` is why the robot said that it halted, if that was heard.
pub fn fault_advice(bits: u16, halted: Option<HaltReason>) -> Vec<Advice> {
    // "Halted" follows from the others: it comes last.
    let order = (0..16).filter(|bit| 1 << bit != faults::HALTED).chain([1]);
    order.map(|bit| 1u16 << bit).filter(|bit| bits & bit != 0).map(|bit| fault(bit, halted)).collect()
}

fn fault(bit: u16, halted: Option<HaltReason>) -> Advice {
    match bit {
        faults::E_STOP => Advice::new(
            "emergency stop, all brakes are on and latched",
            "make sure that nobody is in reach, then press c to clear it and a to arm",
        ),
        faults::HALTED => Advice::new(
            match halted {
                Some(reason) => format!("halted and latched ({})", reason_of(reason)),
                None => "halted and latched".into(),
            },
            "when the cause is gone, press a to arm",
        ),
        faults::IMU_LOST => Advice::new("no IMU sample", "check the ribbon to EXT1, then press a to arm"),
        faults::GENERATION_SPLIT => Advice::new(
            "the nodes do not hold the same parameter generation",
            "it is staged anew by itself; if this stays, check the CAN cable of the node named in the log",
        ),
        faults::STAGING => Advice::new(
            "a parameter change did not finish in time; the set before is in force",
            "let the robot come to rest, see that all three nodes answer, and send the set again",
        ),
        _ => match NodeId::ALL.into_iter().find(|id| bit == faults::NODE_LOST << *id as u16) {
            Some(id) => Advice::new(
                format!("the {} node is silent", node(id)),
                format!("check supply and CAN cable of the {} board, then press a to arm", node(id)),
            ),
            None => unknown("fault", bit),
        },
    }
}

/// Every reason why a node moves less than asked, the same reason of several nodes once.
pub fn limit_advice(nodes: &[u16; 3]) -> Vec<Advice> {
    let bits = (0..16).map(|bit| 1u16 << bit);
    bits.filter_map(|bit| {
        let with = NodeId::ALL.into_iter().zip(nodes).filter(|(_, limits)| *limits & bit != 0);
        let with: Vec<&str> = with.map(|(id, _)| node(id)).collect();
        if with.is_empty() {
            return None;
        }
        let Advice { what, remedy } = limit(bit);
        Some(Advice { what: format!("{what} ({})", with.join(", ")), remedy })
    })
    .collect()
}

fn limit(bit: u16) -> Advice {
    match bit {
        limits::BRAKED => Advice::new("brakes are on", "press a to arm"),
        limits::HALTED => Advice::new("halted, latched", "when the cause is gone, press a to arm"),
        limits::COORDINATOR_LOST => Advice::new(
            "no motion message arrives, so the cycle is finished and braked",
            "check its CAN cable, the coordinator's supply and the IMU",
        ),
        limits::END_STOP => Advice::new(
            "a joint is at the end of its range",
            "harmless for a moment; if it stays, brake, move the leg back and check the joint's zero (docs/wiring.md)",
        ),
        limits::TIMED_OUT => Advice::new(
            "a movement took too long and was given up",
            "check that the actuator runs freely and that its 36 V supply is up",
        ),
        limits::GENERATION_MISSING => Advice::new(
            "the generation in force is missing, the set before serves on",
            "it is staged anew by itself; if this stays, check its CAN cable and restart the node",
        ),
        limits::SENSOR => Advice::new(
            "a sensor reads what cannot be; the last good value serves",
            "check position cables at EXT1 and pad cables at EXT2 (docs/wiring.md)",
        ),
        _ => unknown("limit", bit),
    }
}

fn unknown(kind: &str, bit: u16) -> Advice {
    let bit = bit.trailing_zeros();
    Advice::new(format!("{kind} bit {bit} is not known here"), "the firmware is newer: update this host")
}

/// Why everything brakes.
pub fn reason_of(reason: HaltReason) -> &'static str {
    match reason {
        HaltReason::EmergencyStop => "emergency stop",
        HaltReason::Disarmed => "disarmed",
        HaltReason::NodeFault => "a node failed or restarted",
        HaltReason::ImuLost => "the IMU stopped delivering",
    }
}

/// Why the coordinator last started, and what to do if that was not intended.
pub fn reset_words(cause: ResetCause) -> (&'static str, Option<&'static str>) {
    match cause {
        ResetCause::Unknown => ("not known, or simulated", None),
        ResetCause::PowerOn => ("power came up", None),
        ResetCause::BrownOut => ("the supply sagged", Some("check the 12 V battery and its wiring")),
        ResetCause::External => ("reset pin", None),
        ResetCause::Watchdog => ("watchdog", Some("the firmware hung: look at `sarah flash --node coordinator --run`")),
        ResetCause::Software => ("asked for by software", None),
    }
}

/// An event in a few words.
pub fn event_words(event: &Event) -> String {
    match event {
        Event::Armed => "armed".into(),
        Event::Halted(reason) => format!("halted: {}", reason_of(*reason)),
        Event::EStopCleared => "emergency stop cleared, still braked".into(),
        Event::NodeLost(id) => format!("the {} node fell silent", node(*id)),
        Event::NodeBack(id) => format!("the {} node is back", node(*id)),
        Event::NodeRestarted(id) => format!("the {} node restarted", node(*id)),
        Event::ImuBack => "the IMU delivers again".into(),
        Event::WriterLapsed => "the writing host fell silent".into(),
        Event::Applied { generation, cycle } => format!("generation {generation} applied from cycle {cycle} on"),
        Event::Restaging { generation } => format!("the robot itself stages generation {generation}"),
        Event::GenerationSplit(id) => format!("the {} node did not follow into the new generation", node(*id)),
        Event::StagingFailed { generation } => format!("staging of generation {generation} was given up"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_bit_has_words_and_a_remedy() {
        let known = [faults::E_STOP, faults::HALTED, faults::IMU_LOST, faults::GENERATION_SPLIT, faults::STAGING];
        let nodes = NodeId::ALL.map(|id| faults::NODE_LOST << id as u16);
        for bit in known.into_iter().chain(nodes) {
            let advice = fault_advice(bit, None);
            assert_eq!(advice.len(), 1);
            assert!(!advice[0].what.contains("not known") && !advice[0].remedy.is_empty(), "{bit:#x}: {advice:?}");
        }
        assert_eq!(fault_advice(u16::MAX, None).len(), 16);
        assert!(fault_advice(1 << 12, None)[0].what.contains("fault bit 12 is not known"));
    }

    #[test]
    fn the_cause_stands_before_the_halt_that_followed() {
        let advice = fault_advice(faults::HALTED | faults::IMU_LOST, Some(HaltReason::ImuLost));
        assert_eq!(advice[0].what, "no IMU sample");
        assert_eq!(advice[1].what, "halted and latched (the IMU stopped delivering)");
    }

    #[test]
    fn every_limit_bit_has_words_and_a_remedy() {
        use limits::*;
        for bit in [BRAKED, HALTED, COORDINATOR_LOST, END_STOP, TIMED_OUT, GENERATION_MISSING, SENSOR] {
            let advice = limit_advice(&[0, bit, 0]);
            assert_eq!(advice.len(), 1);
            assert!(advice[0].what.ends_with(" (hip)") && !advice[0].what.contains("not known"), "{advice:?}");
            assert!(!advice[0].remedy.is_empty());
        }
        assert!(limit_advice(&[0; 3]).is_empty());
        assert_eq!(limit_advice(&[u16::MAX; 3]).len(), 16);
    }

    #[test]
    fn a_limit_of_several_nodes_is_said_once() {
        let advice = limit_advice(&[limits::SENSOR, 0, limits::SENSOR]);
        assert_eq!(advice.len(), 1);
        assert!(advice[0].what.ends_with(" (knee, abductor)"));
    }
}
