//! The integrator by matrix exponentials, from the tests of the reference.

#[allow(dead_code, reason = "the tests of the reference use the rest")]
#[path = "../../../dynamics/tests/core/independent"]
pub(crate) mod independent {
    pub(crate) mod random;
}

#[allow(dead_code, reason = "the tests of the reference use the rest")]
#[path = "../../../dynamics/tests/core/machines"]
pub(crate) mod machines {
    mod act;
    pub(crate) mod motion;
    pub(crate) mod random;
    mod roots;
    pub(crate) mod system;
}
