//! Fused multiplication and addition, on processors that have the instruction.

/// Returns `a b + c`. Without the instruction it multiplies and adds separately, because the library function is far
/// slower.
#[inline(always)]
pub(crate) fn fma(a: f64, b: f64, c: f64) -> f64 {
    if cfg!(any(target_feature = "fma", target_arch = "aarch64")) { a.mul_add(b, c) } else { a * b + c }
}
