//! What happened, in words, and what to do about it.

use foxglove::messages::log::Level;
use sarah_protocol::bus::{HaltReason, NodeId};
use sarah_protocol::host::{Command, HelloReply};
use sarah_protocol::session::News;
use sarah_protocol::telemetry::Event;

use crate::link::live::What;

/// The line for an item, if it deserves one.
pub fn line(what: &What) -> Option<(Level, String)> {
    Some(match what {
        What::News(news) => return of_news(news),
        What::Up { port } => (Level::Info, format!("{port} is open")),
        What::Down { why } => (Level::Warning, format!("the port is gone: {why}; it is tried again until it is back")),
        What::NotNow { ask, why } => (Level::Warning, format!("not asked ({ask:?}): {why}")),
    })
}

fn of_news(news: &News) -> Option<(Level, String)> {
    Some(match news {
        News::Telemetry(_) | News::Params(_) | News::Done(Command::Heartbeat { .. } | Command::GetParams(_)) => {
            return None;
        }
        News::Event { event, .. } => of_event(event),
        News::Connected(robot) => (Level::Info, connected(robot)),
        News::Failed(error) => (Level::Error, error.to_string()),
        News::Rebooted => {
            (Level::Warning, "the robot restarted and is braked until armed anew; see its reset cause in /state".into())
        }
        News::Claimed => (Level::Info, "this host is the writer".into()),
        News::Done(command) => (Level::Info, format!("done: {command:?}")),
        News::Refused(command, refusal) => (Level::Warning, format!("refused: {command:?}: {refusal}")),
        News::Staged(generation) => (Level::Info, format!("every node holds generation {generation}")),
        News::Applied { generation, cycle } => {
            (Level::Info, format!("this host's generation {generation} is in force from cycle {cycle} on"))
        }
        News::Renumbered { from, to } => {
            (Level::Info, format!("generation {from} goes on as {to}: the robot knew a newer one"))
        }
        News::Persisted(generation) => (Level::Info, format!("generation {generation} is kept over power cycles")),
    })
}

fn connected(robot: &HelloReply) -> String {
    let HelloReply { version, schema, boot_nonce, board, nodes, build } = robot;
    let build = String::from_utf8_lossy(build);
    format!(
        "robot: build \"{}\", board {board}, protocol {version}, schema {schema:#010x}, boot {boot_nonce:#010x}, \
         nodes heard {nodes:#05b}",
        build.trim_end_matches('\0')
    )
}

fn of_event(event: &Event) -> (Level, String) {
    match event {
        Event::Armed => (Level::Info, "armed: motion is allowed".into()),
        Event::Halted(reason) => {
            let (why, remedy) = match reason {
                HaltReason::EmergencyStop => ("emergency stop", "clear it, then arm"),
                HaltReason::Disarmed => ("disarmed, or the arming host fell silent", "arm to move again"),
                HaltReason::NodeFault => {
                    ("a node fell silent, restarted or did not follow", "see the line before, then arm")
                }
                HaltReason::ImuLost => ("the IMU stopped delivering", "check its SPI connection, then arm"),
            };
            (Level::Error, format!("halted, everything brakes: {why}; {remedy}"))
        }
        Event::EStopCleared => (Level::Info, "emergency stop cleared, still braked; arm to move".into()),
        Event::NodeLost(node) => {
            (Level::Error, format!("the {} node fell silent; check its supply and its CAN connector", name(*node)))
        }
        Event::NodeBack(node) => (Level::Info, format!("the {} node speaks again", name(*node))),
        Event::NodeRestarted(node) => (
            Level::Warning,
            format!(
                "the {} node restarted; the applied set is staged anew, check the node's supply if it was not you",
                name(*node)
            ),
        ),
        Event::ImuBack => (Level::Info, "the IMU delivers again".into()),
        Event::WriterLapsed => {
            (Level::Warning, "the writing host was silent for too long; any host may claim the robot".into())
        }
        Event::Applied { generation, cycle } => {
            (Level::Info, format!("every node runs generation {generation} from cycle {cycle} on"))
        }
        Event::Restaging { generation } => {
            (Level::Warning, format!("the coordinator itself stages generation {generation}"))
        }
        Event::GenerationSplit(node) => (
            Level::Error,
            format!(
                "the {} node did not follow the others into a generation; check its CAN connector, send a set, then arm",
                name(*node)
            ),
        ),
        Event::StagingFailed { generation } => (
            Level::Warning,
            format!("generation {generation} was given up: a node refused it or did not answer; send it again"),
        ),
    }
}

fn name(node: NodeId) -> &'static str {
    match node {
        NodeId::Knee => "knee",
        NodeId::Hip => "hip",
        NodeId::Abductor => "abductor",
    }
}
