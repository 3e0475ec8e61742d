//! Precision of lanes.

use rattlemap_dynamics::named;

named! {
    /// Precision of the motion.
    pub enum Precision {
        /// Single precision, on every adapter.
        F32 = "f32",
        /// Double precision, where the adapter has `SHADER_F64`.
        F64 = "f64",
    }
}

impl Precision {
    /// Bytes of a real number.
    pub fn bytes(self) -> usize {
        match self {
            Precision::F32 => 4,
            Precision::F64 => 8,
        }
    }
}
