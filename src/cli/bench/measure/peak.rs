//! What an adapter could do at most.

use crate::gpu::Precision;

/// An adapter's arithmetic peak, in 10^12 operations per second, a fused multiply-add counting
/// as two: vector units alone, at boost clock, as the vendors' data sheets say.
struct Peak {
    /// Part of the adapter's name.
    name: &'static str,
    f32: f64,
    f64: f64,
}

/// The more special name first.
const PEAKS: [Peak; 11] = [
    Peak { name: "H100 PCIe", f32: 51.2, f64: 25.6 },
    Peak { name: "H100 NVL", f32: 60.3, f64: 30.1 },
    Peak { name: "H100", f32: 66.9, f64: 33.5 },
    Peak { name: "H200", f32: 66.9, f64: 33.5 },
    Peak { name: "A100", f32: 19.5, f64: 9.7 },
    Peak { name: "V100", f32: 15.7, f64: 7.8 },
    Peak { name: "L40S", f32: 91.6, f64: 1.43 },
    Peak { name: "L4", f32: 30.3, f64: 0.47 },
    Peak { name: "RTX 4090", f32: 82.6, f64: 1.29 },
    Peak { name: "RTX 3090", f32: 35.6, f64: 0.56 },
    Peak { name: "Tesla T4", f32: 8.1, f64: 0.25 },
];

/// Operations per second of an adapter at its peak, if its name is known.
pub fn of(device: &str, precision: Precision) -> Option<f64> {
    let peak = PEAKS.iter().find(|peak| device.contains(peak.name))?;
    Some(1e12 * if precision == Precision::F32 { peak.f32 } else { peak.f64 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_special_name_wins_and_unknown_ones_have_none() {
        let f64_of = |device| of(device, Precision::F64);
        assert_eq!(f64_of("NVIDIA H100 PCIe (Vulkan; 550)"), Some(25.6e12));
        assert_eq!(f64_of("NVIDIA H100 80GB HBM3 (Vulkan; 550)"), Some(33.5e12));
        assert_eq!(of("NVIDIA L40S", Precision::F32), Some(91.6e12));
        assert_eq!(f64_of("llvmpipe (LLVM 15.0.6, 256 bits)"), None);
    }
}
