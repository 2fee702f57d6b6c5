//! The control code of the four chips as the library runs it: how it is born, and what a turn of the coordinator is.
//!
//! The software in the loop and whoever repeats a recording of it call the same code in the same way.

use sarah_firmware::coordinator::{Action, BusOutbox, Config, Coordinator, HostOutbox, Identity, ImuSample};
use sarah_firmware::node::{self, NodeConfig, NodeKind};
use sarah_protocol::bus::NodeId;
use sarah_protocol::params::ParamSet;

/// What the chips are born with.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Birth {
    /// Of the coordinator.
    pub boot_nonce: u32,
    /// Arm once, without a host.
    pub arm_at_boot: bool,
    /// Nominal time between IMU samples, µs.
    pub imu_period_us: u32,
    /// The set built into the nodes.
    pub default: ParamSet,
    /// The set in the coordinator's memory.
    pub stored: ParamSet,
}

impl Birth {
    /// A coordinator that has just been powered up.
    pub fn coordinator(&self) -> Coordinator {
        let identity = Identity { boot_nonce: self.boot_nonce, ..Identity::default() };
        Coordinator::new(Config {
            arm_at_boot: self.arm_at_boot,
            imu_period_us: self.imu_period_us,
            ..Config::new(identity, self.default, self.stored)
        })
    }

    /// A node that has just been powered up.
    pub fn node(&self, id: NodeId) -> NodeKind {
        let (end_stop, plausible) = match id {
            NodeId::Knee => node::knee::STROKE,
            NodeId::Hip => node::swing::HIP_SWING,
            NodeId::Abductor => node::swing::ABDUCTOR_SWING,
        };
        node::by_id(id, NodeConfig { default: self.default, boot_nonce: 1, end_stop, plausible })
    }
}

/// One turn of the coordinator: what came from the host, a sample of the IMU, time-outs and telemetry. What it stores is
/// in its memory at once; the set and its generation are returned.
pub fn turn(
    coordinator: &mut Coordinator,
    now_us: u32,
    host_bytes: &[u8],
    sample: &ImuSample,
    bus: &mut BusOutbox,
    host: &mut HostOutbox,
) -> Option<(u32, ParamSet)> {
    coordinator.on_host_bytes(now_us, host_bytes, bus, host);
    coordinator.on_imu(now_us, sample, bus);
    let Action::Store(set, generation) = coordinator.tick(now_us, bus, host)?;
    coordinator.on_stored(generation, true, host);
    Some((generation, set))
}
