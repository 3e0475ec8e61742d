//! Turns panics of wgpu into errors. wgpu panics if a driver fails.
//!
//! wgpu 30 returns no error if a device is lost during a wait, and panics when it drops a partly created object. It
//! has released its locks by then, and none of our state is inconsistent.

use std::cell::Cell;
use std::ops::Deref;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// Whether a panic of this thread becomes an error and is not printed.
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

static HOOK: Once = Once::new();

/// Makes a call. If it panics, returns the message as an error and prints nothing. In web pages a panic ends the process and is printed.
pub(super) fn catch_panic<T>(call: impl FnOnce() -> T) -> Result<T, String> {
    if cfg!(panic = "abort") {
        return Ok(call());
    }
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !IS_CAUGHT.get() {
                before(info);
            }
        }));
    });
    let outer = IS_CAUGHT.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(call));
    IS_CAUGHT.set(outer);
    result.map_err(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        cause(text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or_default())
    })
}

/// A value whose drop may panic.
pub(super) struct PanicFree<T>(Option<T>);

impl<T> PanicFree<T> {
    pub(super) fn new(inner: T) -> PanicFree<T> {
        PanicFree(Some(inner))
    }
}

impl<T> Deref for PanicFree<T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.0.as_ref().expect("the value exists until it is dropped")
    }
}

impl<T> Drop for PanicFree<T> {
    fn drop(&mut self) {
        let inner = self.0.take();
        // The error concerns no caller, because the value no longer exists.
        let _ = catch_panic(|| drop(inner));
    }
}

/// Returns the innermost cause. wgpu lists it last.
fn cause(text: &str) -> String {
    text.lines()
        .map(str::trim)
        .rfind(|line| !line.is_empty())
        .unwrap_or("no reason is given")
        .trim_end_matches('.')
        .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Bomb;

    impl Drop for Bomb {
        fn drop(&mut self) {
            panic!("dropped");
        }
    }

    #[test]
    fn a_panic_during_drop_is_silent() {
        drop(PanicFree::new(Bomb));
    }

    #[test]
    fn a_panic_is_an_error_with_its_innermost_cause() {
        assert_eq!(catch_panic(|| 7), Ok(7));
        let poll = "Error in Device::poll: Validation Error\n\nCaused by:\n  Parent device is lost\n";
        assert_eq!(catch_panic(|| panic!("{poll}")), Err::<(), _>("Parent device is lost".to_owned()));
        assert_eq!(catch_panic(|| panic!("plain")), Err::<(), _>("plain".to_owned()));
        assert_eq!(catch_panic(|| panic!("")), Err::<(), _>("no reason is given".to_owned()));
        // Tests nested calls.
        assert_eq!(catch_panic(|| catch_panic(|| panic!("inner"))), Ok(Err::<(), _>("inner".to_owned())));
        assert!(!IS_CAUGHT.get());
    }
}
