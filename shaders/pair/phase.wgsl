// The forcing phase. It is stored as a whole number of steps and a fraction, not as a time.

// Computes the phasor at the present phase, from the table and by angle addition.
fn sync_phasor() {
    motion.phasor = pairs[shape.phasors + tally.step];
    turn_phasor(motion.theta * here.substeps);
    sync_overtones(tally.step, motion.theta);
}

// Turns the phasor by a part of a step.
fn turn_phasor(part: Real) {
    let turn = small_turn(part * here.angle);
    let c = motion.phasor[0];
    let s = motion.phasor[1];
    motion.phasor[0] = c + (turn.x * c - turn.y * s);
    motion.phasor[1] = s + (turn.y * c + turn.x * s);
}

// A phase: whole free steps since phase 0, and the fraction of the next one.
struct Phase {
    step: u32,
    theta: Real,
}

// Returns the phase after a number of steps of the domain. The fraction is compared with 1 before it is rounded, as in `steps_before`.
fn phase_after(count: u32) -> Phase {
    let steps = Real(count) * here.share;
    let whole = floor(steps);
    let part = steps - whole;
    let rest = 1.0 - part;
    let wraps = motion.theta >= rest;
    return Phase(
        tally.step + u32(whole) + select(0u, 1u, wraps),
        select(min(motion.theta + part, 1.0 - ULP), motion.theta - rest, wraps),
    );
}

// Advances the phase by a part of a free step. The comparison is that of `steps_to_stop_phase`.
fn advance_phase(part: Real) {
    let sum = motion.theta + part;
    if part >= 1.0 - motion.theta {
        motion.theta = max(sum - 1.0, 0.0);
        tally.step += 1u;
    } else {
        motion.theta = min(sum, 1.0 - ULP);
    }
}

// Returns the free steps to the next stop phase; 1 stands for "one or more".
fn steps_to_stop_phase(stop: u32) -> Real {
    if tally.step + 1u < stop {
        return 1.0;
    }
    return 1.0 - motion.theta;
}

// Returns the free steps to the next stop phase or change of the stage; 1 stands for "one or more".
fn steps_to_stop(stop: u32) -> Real {
    if STAGES {
        return min(steps_to_stop_phase(stop), steps_to_change());
    }
    return steps_to_stop_phase(stop);
}
