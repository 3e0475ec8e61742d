//! Walls that only push, and walls with a preload, as further intervals of a lane.
//!
//! Behind such a wall a lane moves in an interval without another wall. Behind a wall that only pushes there are two such intervals, for
//! closed and for open contact. Each interval ends at the wall, and where the force of spring, damper and preload changes its sign.

use std::borrow::Cow;

use rattlemap_dynamics::model::{Contact, Domain, OuterWall, Pair, Side};

/// Whether only the reference can compute the oscillator: a wall that only pushes has a negative preload, so contact begins behind the
/// wall.
pub(in crate::gpu) fn has_negative_preload(oscillator: &Pair) -> bool {
    Side::BOTH.into_iter().any(|side| {
        oscillator.last_wall(side).1 == Contact::Pushing
            && oscillator.preloads(side).any(|preload| preload < 0.0)
    })
}

/// Returns the oscillator with further intervals behind those last walls that only push or have a preload.
pub(super) fn closed_pages(oscillator: &Pair) -> Cow<'_, Pair> {
    let mut whole = Cow::Borrowed(oscillator);
    for side in Side::BOTH.into_iter().filter(|&side| oscillator.is_pushing_or_preloaded(side)) {
        let (i, stages) = (side.index(), oscillator.stage_count());
        let whole = whole.to_mut();
        let meshing = match whole.outer_walls[i].last_mut() {
            Some(last) => {
                last.contact = Contact::Elastic;
                last.meshing.clone()
            }
            None => {
                whole.contacts[i] = Contact::Elastic;
                (0..stages).map(|stage| whole.stage(stage).meshing[i]).collect()
            }
        };
        let at = side.sign() * f64::INFINITY;
        whole.outer_walls[i].push(OuterWall { at, contact: Contact::Elastic, meshing });
    }
    whole
}

/// Returns the domains in front of the last wall and behind it, and the wall's position, in the first stage. `whole` is an oscillator
/// of [`closed_pages`].
fn last_wall(whole: &Pair, side: Side) -> (Domain, Domain, f64) {
    let (i, outer) = (side.index(), &whole.outer_walls[side.index()]);
    let domain = |wall: usize| match wall {
        0 => whole.free,
        1 => whole.meshing[i],
        _ => outer[wall - 2].meshing[0],
    };
    let count = outer.len();
    let at = if count == 1 { whole.walls[i] } else { outer[count - 2].at };
    (domain(count - 1), domain(count), at)
}

/// Returns the oscillator of open contact with the last wall of a side, in the first stage. In this interval the wall is on the other side
/// of the gap.
pub(super) fn open_page(whole: &Pair, side: Side) -> Pair {
    let (front, _, at) = last_wall(whole, side);
    let mut open = Pair {
        free: Domain { preload: 0.0, ..front },
        outer_walls: Default::default(),
        contacts: [Contact::Elastic; 2],
        ..whole.clone()
    };
    open.meshing = [open.free; 2];
    open.walls[side.index()] = side.sign() * f64::INFINITY;
    open.walls[1 - side.index()] = at;
    open
}

/// Returns the force of the last wall of a side, positive if it pushes: factors of gap and rate, and a constant. Forces are accelerations of
/// the gap per step squared.
pub(super) fn push(whole: &Pair, side: Side, h: f64) -> [f64; 3] {
    let (front, behind, at) = last_wall(whole, side);
    let last = Pair { free: behind, ..whole.clone() };
    let [stiffness, damping, _] = last.force_against(&front);
    if behind.damping == front.damping && behind.preload == 0.0 {
        // The wall would never pull.
        return [0.0; 3];
    }
    let (unit, sign) = (whole.mobility(whole.gap), side.sign());
    let (k, c) = (sign * stiffness * unit * h * h, sign * damping * unit * h);
    [k, c, behind.preload * unit * h * h - k * at]
}
