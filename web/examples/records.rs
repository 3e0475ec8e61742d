//! Computes the records of a scene with the arithmetic of a browser: without fused multiplication and addition, and with the
//! functions that Rust links into WebAssembly. A test compares them with those of the page, to the bit.
//!
//!     RUSTFLAGS= cargo run --release --package rattlemap-web --example records < scene.toml > records.bin

use std::io::{Read, Write, stdin, stdout};

use rattlemap_web::Window;

/// Functions of the C library, which the standard library calls. Those of the program win over those of the system.
#[allow(unsafe_code, reason = "the linker finds them by their names")]
mod functions {
    macro_rules! of_libm {
        ($($name:ident($($x:ident),*)),* $(,)?) => {
            $(#[unsafe(no_mangle)]
            extern "C" fn $name($($x: f64),*) -> f64 {
                libm::$name($($x),*)
            })*
        };
    }
    of_libm!(
        sin(x),
        cos(x),
        tan(x),
        exp(x),
        exp2(x),
        expm1(x),
        log(x),
        log2(x),
        log10(x),
        log1p(x),
        pow(x, y),
        hypot(x, y),
        atan(x),
        atan2(y, x),
        sinh(x),
        cosh(x),
        tanh(x),
        cbrt(x),
    );

    /// LLVM joins a sine and a cosine of one number.
    #[unsafe(no_mangle)]
    extern "C" fn sincos(x: f64, sine: &mut f64, cosine: &mut f64) {
        [*sine, *cosine] = [libm::sin(x), libm::cos(x)];
    }
}

fn main() {
    if cfg!(target_feature = "fma") {
        panic!("RUSTFLAGS must be set to nothing");
    }
    let mut scene = String::new();
    stdin().read_to_string(&mut scene).expect("a scene on stdin");
    let window = Window::new(&scene, "", "").expect("a scene");
    let runs: Vec<u32> = (0..window.runs() as u32).collect();
    stdout().write_all(&window.compute(&runs)).expect("records on stdout");
}
