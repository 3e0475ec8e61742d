//! Multiplication and addition in one rounding, where the processor has it.

/// `a b + c`; without the instruction for it a product and a sum, which a call is far slower than.
#[inline(always)]
pub(crate) fn fma(a: f64, b: f64, c: f64) -> f64 {
    if cfg!(any(target_feature = "fma", target_arch = "aarch64")) { a.mul_add(b, c) } else { a * b + c }
}
