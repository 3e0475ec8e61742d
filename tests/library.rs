//! All tests of the library. One program compiles faster than seven, and its tests share devices with compiled shaders.

mod common;
mod core;
mod gallery;
mod lanes;
mod map;
mod report;
mod validate;

/// Random models, and the integrator by matrix exponentials, from the tests of the reference.
#[path = "../dynamics/tests/core"]
#[allow(dead_code, reason = "the tests of the reference use the rest")]
mod reference_tests {
    pub(crate) mod independent {
        pub(crate) mod random;
    }
    pub(crate) mod machines {
        mod act;
        pub(crate) mod motion;
        pub(crate) mod random;
        mod roots;
        pub(crate) mod system;
    }
}
