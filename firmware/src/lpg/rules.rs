//! Constants of the pattern generators that are not trained, in SI units.
//!
//! Found by search on the simulated robot (DESIGN assumptions: 32 kg, 1 m); the trained parameters of Table I are in
//! `sarah_protocol::params`.

use sarah_protocol::fixed::Q16;

/// Times are in microseconds, lengths in metres, angles in radians.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct KneeRules {
    /// A foot is loaded above this contact force, N.
    pub loaded_n: Q16,
    /// Rest between cycles before an ordinary start.
    pub dwell_us: u32,
    /// Rest before a chained start from one foot: the other needs time to land.
    pub chain_dwell_us: u32,
    /// A chained start needs ξ = |rate + ω·lean| above this, rad/s.
    pub chain_xi: Q16,
    /// ω of ξ: natural frequency of the standing robot as a pendulum, 1/s.
    pub pendulum: Q16,
    /// After this much rest the side of the fall chooses the leg; before, legs alternate.
    pub fresh_us: u32,
    /// Step height limits.
    pub step: (Q16, Q16),
    /// Kick height as a fraction of Step.
    pub kick_fraction: Q16,
    /// The kick is cut off after this.
    pub kick_us: u32,
    /// Retraction and extension are cut off after this.
    pub stroke_us: u32,
    /// At touchdown the leg brakes at once above this ξ, rad/s.
    pub brake_xi: Q16,
    /// Below it, it finishes the extension at this speed, m/s.
    pub touchdown_speed: Q16,
    /// The brake is applied this long before the rest position would be reached, plus the margin.
    pub lead_us: u32,
    /// See `lead_us`.
    pub lead_margin: Q16,
}

/// Rules of the linear actuators.
pub const KNEE: KneeRules = KneeRules {
    loaded_n: Q16::lit(15.0),
    dwell_us: 38_700,
    chain_dwell_us: 120_500,
    chain_xi: Q16::lit(0.427),
    pendulum: Q16::lit(3.76),
    fresh_us: 400_000,
    step: (Q16::lit(0.0392), Q16::lit(0.0698)),
    kick_fraction: Q16::lit(0.2708),
    kick_us: 72_000,
    stroke_us: 500_000,
    brake_xi: Q16::lit(0.4),
    touchdown_speed: Q16::lit(0.2674),
    lead_us: 5_000,
    lead_margin: Q16::lit(0.001),
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
    /// The move is given up after this.
    pub move_us: u32,
}

/// LPG2.
pub const HIP: SwingRules = SwingRules {
    axis: 0,
    constant: Q16::lit(0.0298),
    reach: Q16::lit(0.6),
    outward_only: false,
    opposite: Q16::ZERO,
    move_us: 500_000,
};

/// LPG3.
pub const ABDUCTOR: SwingRules = SwingRules {
    axis: 1,
    constant: Q16::lit(0.0241),
    reach: Q16::lit(0.5),
    outward_only: true,
    opposite: Q16::lit(0.1698),
    move_us: 500_000,
};
