//! All tests of the library. One program compiles faster than seven, and its tests share devices with compiled shaders.

mod common;
mod core;
mod gallery;
mod lanes;
mod map;
mod report;
mod validate;
