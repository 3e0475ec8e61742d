// Finds modes of walls and friction that are consistent with a state, by the rules of the reference (dynamics/src/machine/modes.rs).

// Gaps and elements whose modes are decided: gaps that rest on rigid walls, with their sides, and elements without a sliding rate.
var<private> rest_side: array<u32, GAPS>;
var<private> rest_element: array<u32, ELEMENT_SLOTS>;
// Modes that are tried; after a successful search, the modes that were chosen.
var<private> tried_gaps: array<u32, GAPS>;
var<private> tried_slips: array<u32, ELEMENT_SLOTS>;

fn sign_of_slip(slip: u32) -> Real {
    return select(select(Real(0.0), Real(-1.0), slip == BACKWARD), Real(1.0), slip == FORWARD);
}

// Whether the tried modes are consistent with the forces at a state.
fn are_consistent(q: State) -> bool {
    let domain = domain_of(tried_gaps, tried_slips);
    for (var n = 0u; n < GAPS + ELEMENTS; n++) {
        var line: Line;
        var least = 0u;
        var wants_positive = true;
        if n < GAPS {
            let side = rest_side[n];
            if side == SIDE_NONE {
                continue;
            }
            wants_positive = has_push(domain, n);
            if wants_positive {
                line = push_line(domain, n);
            } else {
                // If the wall does not push, the gap must leave it, or friction holds the gap there.
                line = distance_line(n, 0.0, 1u - side);
                least = 2u;
            }
        } else {
            let i = n - GAPS;
            let slip = tried_slips[i];
            if rest_element[i] == 0u {
                continue;
            }
            if slip == STICKS {
                if has_hold(domain, i) {
                    load_sizes(q);
                    let held = product_and_size(hold_row(domain, i), 0u);
                    if abs(held.x) > element_force(i) + ROUNDING * held.y {
                        return false;
                    }
                }
                continue;
            }
            line = rate_line(i, sign_of_slip(slip));
            least = 1u;
        }
        if (lead(line, domain, q, least).value > 0.0) != wants_positive {
            return false;
        }
    }
    return true;
}

// Chooses the first consistent combination of modes: walls hold before they let go, elements stick before they slide. With `keeps`, the
// present modes are tried first. If no combination is consistent, returns false and changes no mode.
fn choose(q: State, keeps: bool) -> bool {
    var releases = 1u;
    for (var gap = 0u; gap < GAPS; gap++) {
        releases *= select(1u, 2u, rest_side[gap] != SIDE_NONE);
    }
    var slides = 1u;
    for (var i = 0u; i < ELEMENTS; i++) {
        slides *= select(1u, 3u, rest_element[i] == 1u);
    }
    let given_gaps = tried_gaps;
    let given_slips = tried_slips;
    let first = select(0u, 1u, keeps);
    for (var n = 0u; n < releases * slides + first; n++) {
        iterations += 1u;
        if n >= first {
            var bits = (n - first) / slides;
            for (var gap = 0u; gap < GAPS; gap++) {
                let side = rest_side[gap];
                if side != SIDE_NONE {
                    tried_gaps[gap] = select(beyond_walls(side, passable(gap, side)), STUCK + side, (bits & 1u) == 0u);
                    bits = bits >> 1u;
                }
            }
            var digits = (n - first) % slides;
            for (var i = ELEMENTS; i > 0u; i--) {
                if rest_element[i - 1u] == 1u {
                    tried_slips[i - 1u] = digits % 3u;
                    digits /= 3u;
                }
            }
        }
        if are_consistent(q) {
            return true;
        }
    }
    tried_gaps = given_gaps;
    tried_slips = given_slips;
    return false;
}

fn is_stuck(mode: u32) -> bool {
    return mode >= STUCK;
}

// Removes rounding errors from the rates of sticking elements and of gaps at rest. `speeds` is 1 for a state and 0 for a tangent vector.
fn hold(q: ptr<function, State>, speeds: Real) {
    var held = 0u;
    for (var gap = 0u; gap < GAPS; gap++) {
        if is_stuck(gap_modes[gap]) {
            held |= 1u << gap;
            (*q)[2u * gap + 1u] = 0.0;
        }
    }
    if ELEMENTS == 0u {
        return;
    }
    var pivots: array<u32, ELEMENT_SLOTS>;
    // Rows may share coordinates, so one pass does not suffice.
    for (var n = 0u; n < 2u * ELEMENTS; n++) {
        let i = n % ELEMENT_SLOTS;
        if i >= shape.elements || slips[i] != STICKS {
            continue;
        }
        let row = AT_ELEMENTS + i * (WIDTH + 1u);
        var factors: array<Real, COORDINATES>;
        var widest = COORDINATES;
        var most: Real = 0.0;
        for (var j = 0u; j < shape.coordinates; j++) {
            factors[j] = number(row + 2u * j + 1u);
            if ((held >> j) & 1u) == 0u && abs(factors[j]) > most {
                widest = j;
                most = abs(factors[j]);
            }
        }
        if n < ELEMENTS {
            pivots[i] = widest;
            held |= (1u << widest);
        }
        let pivot = pivots[i];
        if pivot == COORDINATES {
            continue;
        }
        // The constant of a sliding rate is minus the speed of the surface.
        var rest = speeds * number(row + WIDTH - 1u);
        for (var j = 0u; j < shape.coordinates; j++) {
            if j != pivot {
                rest += factors[j] * (*q)[2u * j + 1u];
            }
        }
        (*q)[2u * pivot + 1u] = -rest / factors[pivot];
    }
}
