//! The program: see `rattlemap --help`.

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::{Write, stderr};
use std::process::ExitCode;

use rattlemap::cli;
use rattlemap::job::{environment, processor};

/// The system's allocator. Without memory it ends the process with advice; Rust's own handler would abort without any.
struct Advising;

#[global_allocator]
static ALLOCATOR: Advising = Advising;

#[allow(unsafe_code, reason = "allocators are unsafe")]
// SAFETY: all calls go to the system's allocator unchanged.
unsafe impl GlobalAlloc for Advising {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller promises, here and below.
        granted(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: see above.
        granted(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: see above.
        granted(unsafe { System.realloc(memory, layout, size) }, size)
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: see above.
        unsafe { System.dealloc(memory, layout) }
    }
}

/// Ends the process with advice if the system gave no memory. Nothing here may need memory.
fn granted(memory: *mut u8, bytes: usize) -> *mut u8 {
    if memory.is_null() {
        let _ = writeln!(
            stderr(),
            "error: the system refuses {bytes} bytes of memory; use a smaller map or a larger machine, or raise the limit \
             (`ulimit -v`). Stored records are kept: `map --resume` goes on with them"
        );
        // Exit handlers could need memory, and threads of libraries may still be running.
        signal_hook::low_level::exit(1);
    }
    memory
}

fn main() -> ExitCode {
    if !processor::is_fit() {
        let _ = stderr().write_all(processor::MISFIT.as_bytes());
        return ExitCode::FAILURE;
    }
    if let Some((name, value)) = environment::missing_variable() {
        #[allow(unsafe_code, reason = "a library of the system reads its settings from the environment")]
        // SAFETY: no other thread exists that could read the environment at the same time.
        unsafe {
            std::env::set_var(name, value);
        }
    }
    cli::run()
}
