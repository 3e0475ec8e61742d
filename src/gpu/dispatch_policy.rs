//! How often does the host check its lanes?

use web_time::Duration;

/// How lanes are driven on a device. What they give depends on `late_tangent` and `keep` alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct DispatchPolicy {
    /// Dispatches of one round, between two checks: a lane that has read a cycle goes on in the next one.
    pub(super) dispatches: u32,
    /// How long a round should take.
    pub(super) round: Duration,
    /// Rounds after which lanes that have ended wait no longer for others.
    pub(super) patience: u32,
    /// Whether lanes begin in a variant without the tangent vector and change over when they need it: less work,
    /// but the two variants take turns.
    pub(super) late_tangent: bool,
    /// Whether lanes keep copies of all their constants.
    pub(super) keep: bool,
}

/// In software a round costs the more the more lanes there are, and work is what counts.
const SOFTWARE: DispatchPolicy = DispatchPolicy {
    dispatches: 4,
    round: Duration::from_millis(100),
    patience: 8,
    late_tangent: true,
    keep: true,
};

/// Hardware that shares the processor's memory and draws the screen: work counts there, too.
const INTEGRATED: DispatchPolicy = DispatchPolicy {
    dispatches: 4,
    round: Duration::from_millis(10),
    patience: 4,
    late_tangent: true,
    keep: false,
};

/// Hardware with more lanes than a map keeps busy: there cells that wait for each other's records are what counts,
/// so that checks follow each other after some 64 periods of a lane, and all lanes run side by side.
const DEDICATED: DispatchPolicy = DispatchPolicy {
    dispatches: 8,
    round: Duration::from_millis(2),
    patience: 4,
    late_tangent: false,
    keep: false,
};

impl DispatchPolicy {
    /// That of a kind of adapter.
    pub(super) fn of(kind: wgpu::DeviceType) -> DispatchPolicy {
        match kind {
            wgpu::DeviceType::Cpu => SOFTWARE,
            wgpu::DeviceType::IntegratedGpu | wgpu::DeviceType::Other => INTEGRATED,
            wgpu::DeviceType::DiscreteGpu | wgpu::DeviceType::VirtualGpu => DEDICATED,
        }
    }
}
