//! Calls into wgpu that panic where a driver fails, as errors.
//!
//! wgpu 30 has no error for a device that is lost while it is waited for, and drops what it has made of a device by halves
//! with an assertion. By then it has let go of its locks, and nothing of ours is half done.

use std::cell::Cell;
use std::ops::Deref;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// Whether a panic of this thread is somebody's error, and no news for the terminal.
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

static HOOK: Once = Once::new();

/// Makes a call; if it panics, what it says, without a word on the terminal. Where panics end the process (in web pages)
/// they do so aloud.
pub(super) fn caught<T>(call: impl FnOnce() -> T) -> Result<T, String> {
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
    let made = panic::catch_unwind(AssertUnwindSafe(call));
    IS_CAUGHT.set(outer);
    made.map_err(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        cause(text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or_default())
    })
}

/// What may panic while it is dropped.
pub(super) struct Dropped<T>(Option<T>);

impl<T> Dropped<T> {
    pub(super) fn new(inner: T) -> Dropped<T> {
        Dropped(Some(inner))
    }
}

impl<T> Deref for Dropped<T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.0.as_ref().expect("it is there until it is dropped")
    }
}

impl<T> Drop for Dropped<T> {
    fn drop(&mut self) {
        let inner = self.0.take();
        // Nobody is left who could be told.
        let _ = caught(|| drop(inner));
    }
}

/// The innermost cause: wgpu lists them one below the other.
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
    fn what_panics_when_it_is_dropped_does_so_unheard() {
        drop(Dropped::new(Bomb));
    }

    #[test]
    fn a_panic_is_an_error_with_its_innermost_cause() {
        assert_eq!(caught(|| 7), Ok(7));
        let poll = "Error in Device::poll: Validation Error\n\nCaused by:\n  Parent device is lost\n";
        assert_eq!(caught(|| panic!("{poll}")), Err::<(), _>("Parent device is lost".to_owned()));
        assert_eq!(caught(|| panic!("plain")), Err::<(), _>("plain".to_owned()));
        assert_eq!(caught(|| panic!("")), Err::<(), _>("no reason is given".to_owned()));
        // Within another one, too.
        assert_eq!(caught(|| caught(|| panic!("inner"))), Ok(Err::<(), _>("inner".to_owned())));
        assert!(!IS_CAUGHT.get());
    }
}
