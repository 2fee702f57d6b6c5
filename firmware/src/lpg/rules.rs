//! Constants of the pattern generators that are not trained, in SI units.
//!
//! Found by search and by hand on the simulated robot (DESIGN assumptions: 32 kg, 1 m); the trained parameters of Table I are in
//! `sarah_protocol::params`.

use sarah_protocol::fixed::Q16;

/// Times are in microseconds, lengths in metres, angles in radians. ξ = rate + ω·lean, rad/s, tells along each axis
/// \[sagittal, lateral\] where a fall is heading: it is the capture point's distance from the feet times ω over height.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct KneeRules {
    /// A foot is loaded above this contact force, N.
    pub loaded_n: Q16,
    /// ω of ξ: natural frequency of the standing robot as a pendulum, 1/s.
    pub pendulum: Q16,
    /// Weight of (rate − slow rate) in ξ ahead. The slow rate lags by its time constant τ, so this looks this many τ ahead:
    /// a push shows while it acts.
    pub ahead: Q16,
    /// Rest between cycles before an ordinary start.
    pub dwell_us: u32,
    /// An ordinary start needs ξ ahead beyond one of these: short of them the feet hold the robot.
    pub start_xi: [Q16; 2],
    /// Rest before a chained start from one foot: the other needs time to land. For as long, one that has landed in a
    /// sagittal fall counts as standing.
    pub chain_dwell_us: u32,
    /// A chained start needs |ξ| above this …
    pub chain_xi: Q16,
    /// … and, if the foot in the air is not on the side of the fall, sagittal ξ above this.
    pub chain_sagittal_xi: Q16,
    /// After this much rest the side of the fall chooses the leg; before, legs alternate.
    pub fresh_us: u32,
    /// Step height limits.
    pub step: (Q16, Q16),
    /// Kick height as a fraction of Step.
    pub kick_fraction: Q16,
    /// The kick is cut off after this.
    pub kick_us: u32,
    /// A foot that alone carries the robot, after the kick or to hop, is lifted only with ξ ahead beyond one of these.
    pub lift_xi: [Q16; 2],
    /// A foot whose leg is this much shorter than when the cycle began has left the ground, whatever the pads say: they
    /// give 4 mm.
    pub lift: Q16,
    /// Retraction and extension are cut off after this.
    pub stroke_us: u32,
    /// While |ξ| is above this the robot falls.
    pub fall_xi: Q16,
    /// A falling robot reaches for the ground this far beyond rest, once the pads have had as long to tell of touchdown as
    /// they took to tell of lift-off; a leg that lands while falling brakes at once.
    pub reach: Q16,
    /// It waits for them no longer than this.
    pub wait_us: u32,
    /// Pads that took longer than this to tell of lift-off are too late to stop hip and abductor at touchdown: …
    pub late_us: u32,
    /// … a leg that is no more than this short of rest is taken to be down.
    pub near: Q16,
    /// An extension ends where the sensor sees the leg this far beyond its goal: more than a kick, and a leg that was kicked
    /// is where a late one may see it still.
    pub beyond: Q16,
    /// Otherwise it finishes the extension to rest at this speed, m/s.
    pub touchdown_speed: Q16,
    /// The brake is applied this long before the goal of the extension would be reached, plus the margin.
    pub lead_us: u32,
    /// See `lead_us`.
    pub lead_margin: Q16,
    /// On both feet and turning slower than this the robot is calm, rad/s.
    pub calm: Q16,
    /// Calm for so long, it brings legs that have stepped back to rest, one after the other.
    pub calm_us: u32,
    /// Every recovery that ends in steps doubles that time, up to this.
    pub patience_us: u32,
    /// Before its first cycle since it was armed, the robot has been calm on both feet for so long …
    pub stand_us: u32,
    /// … or has waited for that long enough.
    pub stand_at_most_us: u32,
    /// Step height of a recovery cycle.
    pub recovery_step: Q16,
    /// A leg that is shorter than rest by more than this has not come home: it recovers again …
    pub home: Q16,
    /// … up to so many recoveries since the last step.
    pub recoveries: u8,
    /// It grows back to rest where it stands, at this speed, m/s, before it is lifted …
    pub straighten: Q16,
    /// … once the robot has been calm for so long …
    pub straighten_us: u32,
    /// … and is cut off after this.
    pub straighten_at_most_us: u32,
}

/// Rules of the linear actuators.
pub const KNEE: KneeRules = KneeRules {
    loaded_n: Q16::lit(15.0),
    pendulum: Q16::lit(3.76),
    ahead: Q16::lit(1.7765),
    dwell_us: 40_000,
    start_xi: [Q16::lit(0.5773), Q16::lit(0.25)],
    chain_dwell_us: 120_000,
    chain_xi: Q16::lit(0.3992),
    chain_sagittal_xi: Q16::lit(0.3038),
    fresh_us: 400_600,
    step: (Q16::lit(0.0411), Q16::lit(0.0641)),
    kick_fraction: Q16::lit(0.1323),
    kick_us: 66_600,
    lift_xi: [Q16::lit(0.3879), Q16::lit(0.644)],
    lift: Q16::lit(0.012),
    stroke_us: 500_000,
    fall_xi: Q16::lit(0.2701),
    reach: Q16::lit(0.0451),
    wait_us: 150_000,
    late_us: 50_000,
    near: Q16::lit(0.02),
    beyond: Q16::lit(0.015),
    touchdown_speed: Q16::lit(0.3121),
    lead_us: 5_000,
    lead_margin: Q16::lit(0.001),
    calm: Q16::lit(0.05),
    calm_us: 800_000,
    patience_us: 12_800_000,
    stand_us: 150_000,
    stand_at_most_us: 1_500_000,
    recovery_step: Q16::lit(0.0213),
    home: Q16::lit(0.008),
    recoveries: 12,
    straighten: Q16::lit(0.08),
    straighten_us: 650_000,
    straighten_at_most_us: 1_000_000,
};

/// Rules of one swing generator.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SwingRules {
    /// Index of the lean axis in `Motion` (0 sagittal, 1 lateral).
    pub axis: usize,
    /// Offset of the target beyond the dead band, rad.
    pub constant: Q16,
    /// Largest target, rad.
    pub reach: Q16,
    /// Abductors move their leg outward only; hips move both ways.
    pub outward_only: bool,
    /// Outward target of a leg opposite the fall per unit of x, s.
    pub opposite: Q16,
    /// The other leg turns the opposite way by this fraction of what the swing leg has to go …
    pub scissor: Q16,
    /// … at this speed, rad/s.
    pub scissor_speed: Q16,
    /// The move is given up after this.
    pub move_us: u32,
}

/// LPG2.
pub const HIP: SwingRules = SwingRules {
    axis: 0,
    constant: Q16::lit(0.025),
    reach: Q16::lit(0.582),
    outward_only: false,
    opposite: Q16::ZERO,
    scissor: Q16::lit(0.3),
    scissor_speed: Q16::lit(1.5),
    move_us: 500_000,
};

/// LPG3.
pub const ABDUCTOR: SwingRules = SwingRules {
    axis: 1,
    constant: Q16::lit(0.0245),
    reach: Q16::lit(0.4383),
    outward_only: true,
    opposite: Q16::lit(0.1652),
    scissor: Q16::lit(0.15),
    scissor_speed: Q16::lit(1.5),
    move_us: 500_000,
};
