//! Variables that the program sets in its own environment.

use std::ffi::OsString;
use std::path::Path;

/// Variables that tell Wayland's library where its display is: the folder, and the name or path.
const FOLDER: &str = "XDG_RUNTIME_DIR";
const DISPLAY: &str = "WAYLAND_DISPLAY";

/// A path that is never a display.
const NOWHERE: &str = "/dev/null";

/// Returns a variable that the program should set before anything else, and its value. None on a desktop.
///
/// A layer of Mesa's Vulkan drivers opens a Wayland display to find the card of the screen. If there is no folder for
/// displays, Wayland's library prints an error on stderr. The library needs no folder if the name of the display is a path.
pub fn missing_variable() -> Option<(&'static str, &'static str)> {
    if cfg!(all(unix, not(target_os = "macos"))) { no_display(|name| std::env::var_os(name)) } else { None }
}

fn no_display(value: impl Fn(&str) -> Option<OsString>) -> Option<(&'static str, &'static str)> {
    let is_path = |name| value(name).is_some_and(|value| Path::new(&value).is_absolute());
    (!is_path(FOLDER) && !is_path(DISPLAY)).then_some((DISPLAY, NOWHERE))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_display_that_exists_stays() {
        let with = |pairs: &'static [(&str, &str)]| {
            no_display(|name| pairs.iter().find(|pair| pair.0 == name).map(|pair| pair.1.into()))
        };
        assert_eq!(with(&[]), Some((DISPLAY, NOWHERE)));
        assert_eq!(with(&[(FOLDER, "relative"), (DISPLAY, "wayland-0")]), Some((DISPLAY, NOWHERE)));
        assert_eq!(with(&[(FOLDER, "/run/user/1000"), (DISPLAY, "wayland-0")]), None);
        assert_eq!(with(&[(DISPLAY, "/run/user/1000/wayland-0")]), None);
    }
}
