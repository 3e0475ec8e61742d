// The forcing phase. It is stored as a whole number of steps and a fraction, not as a time.

// Computes the phasor at `theta` of a free step after step `n`, from the table and by angle addition.
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

// Advances the phase by a part of a free step.
fn advance_phase(part: Real) {
    motion.theta += part;
    if motion.theta >= 1.0 {
        motion.theta -= 1.0;
        tally.step += 1u;
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
