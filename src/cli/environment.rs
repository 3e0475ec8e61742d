//! What the program's own environment lacks, before anything runs.

use std::ffi::OsString;
use std::path::Path;

/// Where Wayland's library looks for a display.
const FOLDER: &str = "XDG_RUNTIME_DIR";
const DISPLAY: &str = "WAYLAND_DISPLAY";

/// A place at which no display can be.
const NOWHERE: &str = "/dev/null";

/// A variable that the program should set for itself, first thing, and its value: none on a desktop.
///
/// A layer of Mesa's Vulkan drivers asks for a Wayland display to find the card of the screen, whether or not anybody wants
/// one. Where there is no folder in which a display could be, Wayland's library complains of that on stderr. A name that is
/// a path needs no folder.
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
    fn a_desktop_keeps_its_display() {
        let with = |pairs: &'static [(&str, &str)]| {
            no_display(|name| pairs.iter().find(|pair| pair.0 == name).map(|pair| pair.1.into()))
        };
        assert_eq!(with(&[]), Some((DISPLAY, NOWHERE)));
        assert_eq!(with(&[(FOLDER, "relative"), (DISPLAY, "wayland-0")]), Some((DISPLAY, NOWHERE)));
        assert_eq!(with(&[(FOLDER, "/run/user/1000"), (DISPLAY, "wayland-0")]), None);
        assert_eq!(with(&[(DISPLAY, "/run/user/1000/wayland-0")]), None);
    }
}
