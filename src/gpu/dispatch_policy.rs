//! How the host drives lanes on a kind of adapter.

use web_time::Duration;

/// Settings by which the host dispatches lanes. Only `late_tangent` affects records, by rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DispatchPolicy {
    /// Number of repetitions in a round: lists, some periods, lists, judging.
    pub(super) dispatches: u32,
    /// Desired duration of a round, from one check to the next.
    pub(super) round: Duration,
    /// Largest number of lanes with which a round of [`FEWEST_ITERATIONS`](super::rounds) certainly takes less than a
    /// second.
    pub(super) at_once: u32,
    /// Number of periods after which lists are made again in the first round, unless there are very many lanes.
    pub(super) first_periods: u32,
    /// Number of rounds after which results of ended lanes are read even if few lanes have ended, provided that further lanes can begin.
    pub(super) patience: u32,
    /// Whether lanes begin in a variant without the tangent vector and change to the variant with the vector when they need it. This
    /// reduces the work, but the variants run one after the other.
    pub(super) late_tangent: bool,
    /// If a list has at most this many lanes, each gets a warp of its own.
    pub(super) few_lanes: u32,
    /// Longest time to wait for a submission. A device that takes longer counts as lost.
    pub(super) longest_wait: Duration,
    /// Duration of one iteration of a dispatch on a simulated device, for tests; `None` measures the rounds of a real device.
    pub(super) simulated: Option<Duration>,
}

/// Rounds usually take some milliseconds; on a busy processor they take seconds.
const LONGEST_WAIT: Duration = Duration::from_secs(300);

/// Software: the duration of a round grows with the number of lanes, and only the amount of work matters.
const SOFTWARE: DispatchPolicy = DispatchPolicy {
    dispatches: 4,
    round: Duration::from_millis(100),
    at_once: 1 << 14,
    first_periods: 1,
    patience: 8,
    late_tangent: true,
    few_lanes: 0,
    longest_wait: LONGEST_WAIT,
    simulated: None,
};

/// Hardware that shares the processor's memory and draws the screen. The amount of work matters as it does for software.
const INTEGRATED: DispatchPolicy =
    DispatchPolicy { round: Duration::from_millis(10), patience: 4, ..SOFTWARE };

/// Hardware that runs all lanes under way side by side. A round costs the host more time than the first lanes of a map cost the device, so
/// rounds are few and long.
pub(super) const DEDICATED: DispatchPolicy = DispatchPolicy {
    dispatches: 16,
    round: Duration::from_millis(32),
    at_once: 1 << 17,
    first_periods: 4,
    late_tangent: false,
    few_lanes: 1 << 10,
    ..INTEGRATED
};

/// Hardware behind a browser: a card, or the integrated graphics of a laptop.
const BROWSER: DispatchPolicy = DispatchPolicy { at_once: 1 << 14, ..DEDICATED };

impl DispatchPolicy {
    /// Returns the policy for an adapter. A browser does not report the kind of its hardware.
    pub(super) fn of(info: &wgpu::AdapterInfo) -> DispatchPolicy {
        match info.device_type {
            wgpu::DeviceType::Cpu => SOFTWARE,
            wgpu::DeviceType::Other if info.backend == wgpu::Backend::BrowserWebGpu => BROWSER,
            wgpu::DeviceType::IntegratedGpu | wgpu::DeviceType::Other => INTEGRATED,
            wgpu::DeviceType::DiscreteGpu | wgpu::DeviceType::VirtualGpu => DEDICATED,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hardware_of_a_browser_is_driven_like_a_card() {
        let info = |kind, backend| wgpu::AdapterInfo::new(kind, backend);
        for (kind, backend, expected) in [
            (wgpu::DeviceType::Other, wgpu::Backend::BrowserWebGpu, BROWSER),
            (wgpu::DeviceType::Cpu, wgpu::Backend::BrowserWebGpu, SOFTWARE),
            (wgpu::DeviceType::Other, wgpu::Backend::Vulkan, INTEGRATED),
            (wgpu::DeviceType::DiscreteGpu, wgpu::Backend::Vulkan, DEDICATED),
        ] {
            assert_eq!(DispatchPolicy::of(&info(kind, backend)), expected, "{kind:?} {backend:?}");
        }
    }
}
