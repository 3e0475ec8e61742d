//! How often does the host look at its lanes?

use web_time::Duration;

/// How lanes are driven on a device. What they give depends on `late_tangent` and `keep` alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rhythm {
    /// Dispatches of one round, between two looks: a lane that has read a cycle goes on in the next one.
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
const SOFTWARE: Rhythm =
    Rhythm { dispatches: 4, round: Duration::from_millis(100), patience: 8, late_tangent: true, keep: true };

/// Hardware that shares the processor's memory and draws the screen: work counts there, too.
const INTEGRATED: Rhythm =
    Rhythm { dispatches: 4, round: Duration::from_millis(10), patience: 4, late_tangent: true, keep: false };

/// Hardware with more lanes than a map keeps busy: there cells that wait for each other's records are what counts,
/// so that looks follow each other after some 64 periods of a lane, and all lanes run side by side.
const DEDICATED: Rhythm =
    Rhythm { dispatches: 8, round: Duration::from_millis(2), patience: 4, late_tangent: false, keep: false };

impl Rhythm {
    /// That of a kind of adapter.
    pub(super) fn of(kind: wgpu::DeviceType) -> Rhythm {
        match kind {
            wgpu::DeviceType::Cpu => SOFTWARE,
            wgpu::DeviceType::IntegratedGpu | wgpu::DeviceType::Other => INTEGRATED,
            wgpu::DeviceType::DiscreteGpu | wgpu::DeviceType::VirtualGpu => DEDICATED,
        }
    }
}
