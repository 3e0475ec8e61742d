//! How the host drives lanes on a kind of adapter.

use web_time::Duration;

/// How lanes are driven. Records depend on `late_tangent` and `keep` alone, by rounding.
#[derive(Clone, Copy, Debug)]
pub(super) struct DispatchPolicy {
    /// Dispatches of a round, between two checks. A lane that has read a cycle continues in the next dispatch.
    pub(super) dispatches: u32,
    /// Desired duration of a round.
    pub(super) round: Duration,
    /// Rounds after which lanes that have ended no longer wait for others.
    pub(super) patience: u32,
    /// Whether lanes begin in a variant without the tangent vector and change to the other variant when they need it.
    /// That is less work, but the variants run one after the other.
    pub(super) late_tangent: bool,
    /// Whether lanes keep copies of all their constants.
    pub(super) keep: bool,
}

/// Software: the duration of a round grows with the number of lanes, and only the amount of work matters.
const SOFTWARE: DispatchPolicy = DispatchPolicy {
    dispatches: 4,
    round: Duration::from_millis(100),
    patience: 8,
    late_tangent: true,
    keep: true,
};

/// Hardware that shares the processor's memory and draws the screen: the amount of work matters there, too.
const INTEGRATED: DispatchPolicy = DispatchPolicy {
    dispatches: 4,
    round: Duration::from_millis(10),
    patience: 4,
    late_tangent: true,
    keep: false,
};

/// Hardware with room for more lanes than a map has: the wait for cells that others depend on matters. Checks follow
/// each other after about 64 periods of a lane, and all lanes run side by side.
const DEDICATED: DispatchPolicy = DispatchPolicy {
    dispatches: 8,
    round: Duration::from_millis(2),
    patience: 4,
    late_tangent: false,
    keep: false,
};

impl DispatchPolicy {
    /// Returns the policy for a kind of adapter.
    pub(super) fn of(kind: wgpu::DeviceType) -> DispatchPolicy {
        match kind {
            wgpu::DeviceType::Cpu => SOFTWARE,
            wgpu::DeviceType::IntegratedGpu | wgpu::DeviceType::Other => INTEGRATED,
            wgpu::DeviceType::DiscreteGpu | wgpu::DeviceType::VirtualGpu => DEDICATED,
        }
    }
}
