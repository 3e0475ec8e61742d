//! Constants of machines: oscillators of up to eight coordinates with several gaps and dry friction.
//!
//! Lanes find the equations of motion of their domain in a table, which `shaders/machine/layout.wgsl` describes.

use std::cell::RefCell;
use std::sync::Arc;

use nalgebra::Complex;

use crate::record::limits::MOST_STEPS;
use rattlemap_dynamics::machine::{StartModes, System};
use rattlemap_dynamics::model::{Contact, NonImpacting, Oscillator, STATE, Side, State, Wall};

/// Largest number of gaps for which a lane's start has room.
pub(super) const MOST_GAPS: usize = 3;

/// Largest number of domains in a table.
pub(super) const MOST_DOMAINS: usize = 4096;

/// Sizes of a flow, of its shape and of a law in the shader.
pub(super) const FLOW: usize = 8 + STATE;
pub(super) const SHAPE: usize = 31;
pub(super) const LAW: usize = 24;

/// Number of entries of a start besides the state: the packed modes, and the next change of the stage.
pub(super) const MODES: usize = 4;

/// Steps of the grid per turn of the highest harmonic. In one step it turns by less than a radian.
const STEPS_PER_TURN: u32 = 8;

/// Stands for an unlimited step in the table, in time units, for machines without stiffness and damping. The value can be stored in f32.
const LONGEST_STEP: f64 = 1e30;

/// Stands for an unlimited energy in the table. The value can be stored in f32.
const LARGEST_ENERGY: f64 = 1e30;

/// Sizes of machines, for which shaders are compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MachineShape {
    /// Number of coordinates, at least 2.
    pub coordinates: u32,
    /// Number of gaps.
    pub gaps: u32,
    /// Largest number of elements with dry friction.
    pub elements: u32,
    /// Largest number of harmonics of the force.
    pub harmonics: u32,
    /// Largest number of walls on one side of a gap.
    pub walls: u32,
    /// Largest number of stages.
    pub stages: u32,
}

impl MachineShape {
    /// Returns the sizes of a machine.
    pub fn of(machine: &Oscillator) -> MachineShape {
        let walls = machine.gaps.iter().flat_map(|gap| &gap.walls).map(Vec::len);
        MachineShape {
            coordinates: machine.degrees().max(2) as u32,
            gaps: machine.gaps.len() as u32,
            elements: machine.friction.len() as u32,
            harmonics: machine.drives.len() as u32,
            walls: walls.max().unwrap_or(0).max(1) as u32,
            stages: machine.stages.len() as u32,
        }
    }

    /// Returns sizes that suffice for both.
    pub fn and(self, other: MachineShape) -> MachineShape {
        MachineShape {
            coordinates: self.coordinates.max(other.coordinates),
            gaps: self.gaps.max(other.gaps),
            elements: self.elements.max(other.elements),
            harmonics: self.harmonics.max(other.harmonics),
            walls: self.walls.max(other.walls),
            stages: self.stages.max(other.stages),
        }
    }

    /// Numbers of a lane's state.
    pub(super) fn dim(&self) -> usize {
        2 * self.coordinates as usize
    }

    /// Number of entries of a point, on which forces depend: the state, two numbers for each harmonic, and 1. Zeros before the 1 fill up to
    /// a multiple of four.
    pub(super) fn width(&self) -> usize {
        (self.dim() + 2 * self.harmonics as usize + 1).next_multiple_of(4)
    }

    /// Returns the names and values of the shader's constants for places in the table.
    pub(super) fn places(&self) -> [(&'static str, usize); 13] {
        let [n, gaps, elements] = [self.coordinates, self.gaps, self.elements].map(|size| size as usize);
        let (width, sides) = (self.width(), 2 * gaps * self.walls as usize);
        let walls = n * n;
        let springs = walls + sides;
        let energy = springs + 3 * sides * self.stages as usize;
        let of_elements = energy + 2 * n * n;
        let still = 1;
        let has_push = still + gaps;
        let has_hold = has_push + gaps;
        let accelerations = has_hold + elements;
        let pushes = accelerations + n * width;
        let holds = pushes + gaps * width;
        [
            ("WIDTH", width),
            ("AT_MOBILITY", 0),
            ("AT_WALLS", walls),
            ("AT_SPRINGS", springs),
            ("AT_ENERGY", energy),
            ("AT_ELEMENTS", of_elements),
            ("AT_DOMAINS", of_elements + elements * (width + 1)),
            ("IN_DOMAIN_STILL", still),
            ("IN_DOMAIN_HAS_PUSH", has_push),
            ("IN_DOMAIN_HAS_HOLD", has_hold),
            ("IN_DOMAIN_ACCELERATIONS", accelerations),
            ("IN_DOMAIN_PUSHES", pushes),
            ("IN_DOMAIN_HOLDS", holds),
        ]
    }

    /// Returns the names and values of the shader's constants for all sizes and places.
    pub(super) fn sizes(&self) -> Vec<(&'static str, u32)> {
        let mut sizes: Vec<_> = self.places().map(|(name, place)| (name, place as u32)).to_vec();
        sizes.extend([
            ("GAPS", self.gaps),
            ("ELEMENTS", self.elements),
            ("ELEMENT_SLOTS", self.elements.max(1)),
            ("WALLS", self.walls),
            ("DOMAIN", self.domain() as u32),
        ]);
        sizes
    }

    fn place(&self, name: &str) -> usize {
        let found = self.places().into_iter().find(|&(other, _)| other == name);
        found.map(|(_, place)| place).expect("the place has a name")
    }

    /// Returns the size of a domain in the table.
    pub(super) fn domain(&self) -> usize {
        self.place("IN_DOMAIN_HOLDS") + self.elements as usize * self.width()
    }

    /// Returns the size of a machine's table.
    fn table(&self, domains: usize) -> usize {
        self.place("AT_DOMAINS") + domains * self.domain()
    }
}

/// Returns the number of domains of a machine.
pub(super) fn domain_count(machine: &Oscillator) -> usize {
    let modes = |walls: &[Vec<Wall>; 2]| walls.iter().map(Vec::len).sum::<usize>() + 1;
    let of_gaps: usize = machine.gaps.iter().map(|gap| modes(&gap.walls)).product();
    machine.stages.len() * of_gaps * 3_usize.pow(machine.friction.len() as u32)
}

/// Returns the bytes of the table of a machine.
pub(super) fn bytes(machine: &Oscillator) -> usize {
    MachineShape::of(machine).table(domain_count(machine)) * size_of::<f64>()
}

/// Constants of one machine.
#[derive(Clone, Debug)]
pub(super) struct MachineConstants {
    system: Box<System>,
    /// Steps of the grid per forcing period.
    pub(super) steps: u32,
    /// The equations of motion of all domains.
    tables: Arc<MachineTable>,
}

/// Data that machines share if they differ only in frequency and contact laws.
#[derive(Debug)]
pub(super) struct MachineTable {
    machine: Oscillator,
    equations: Vec<rattlemap_dynamics::machine::Equations>,
}

thread_local! {
    /// The last table that was built. Neighbouring cells often have the same table.
    static LAST: RefCell<Option<Arc<MachineTable>>> = const { RefCell::new(None) };
}

impl MachineConstants {
    /// Derives the constants of a machine for a number of steps.
    pub(super) fn new(machine: &Oscillator, steps: u32) -> MachineConstants {
        let system = Box::new(System::new(machine));
        let bare = machine.without_laws();
        let tables = LAST.with_borrow_mut(|last| match last {
            Some(tables) if tables.machine == bare => Arc::clone(tables),
            _ => {
                // Built from the machine without its laws, so that the equations do not depend on which cell needs them first.
                let equations = System::new(&bare).equations();
                let tables = Arc::new(MachineTable { machine: bare, equations });
                *last = Some(Arc::clone(&tables));
                tables
            }
        });
        MachineConstants { system, steps, tables }
    }

    /// Returns the steps of the grid per forcing period: `requested`, or as many as the harmonics need.
    pub(super) fn steps(machine: &Oscillator, requested: Option<u32>) -> Option<u32> {
        let needed = STEPS_PER_TURN * machine.highest_order();
        let steps = requested.unwrap_or(0).max(needed).next_multiple_of(2);
        (steps <= MOST_STEPS).then_some(steps)
    }

    /// Returns the forcing period.
    fn period(&self) -> f64 {
        self.system.period()
    }

    /// Returns the number of coordinates.
    pub(super) fn degrees(&self) -> usize {
        self.system.machine().degrees()
    }

    /// Returns the shared table, whose address identifies it.
    pub(super) fn shared(&self) -> &Arc<MachineTable> {
        &self.tables
    }

    /// Returns the numbers of the shader's flow.
    pub(super) fn flow(&self) -> [f64; FLOW] {
        let (length, speed, escape) = self.system.units();
        let escape = if escape.is_finite() { escape } else { -1.0 };
        let (omega, order) = (self.system.machine().omega, self.system.machine().highest_order());
        let mut flow = [0.0; FLOW];
        flow[..8].copy_from_slice(&[
            omega,
            self.period() / f64::from(self.steps),
            length,
            speed,
            escape,
            1.0 / (omega * f64::from(order)),
            -1.0,
            0.0,
        ]);
        let motion = NonImpacting::of_machine(self.system.machine());
        // Lanes in single precision cannot tell whether a body is at rest, so motions that require this are excluded.
        if let Some(motion) = motion.filter(|motion| motion.resting().is_none()) {
            // Without walls the limit of the energy is infinite.
            flow[6] = motion.reach().min(LARGEST_ENERGY);
            flow[7] = motion.exponent() * self.period() / std::f64::consts::LN_2;
            flow[8..].copy_from_slice(&self.system.listed_state(&motion.steady()));
        }
        flow
    }

    /// Returns the largest multiplier of motion without contact.
    pub(super) fn contact_free_multiplier(&self) -> Option<Complex<f64>> {
        let motion = NonImpacting::of_machine(self.system.machine())?;
        let [re, im] = motion.multiplier(self.period());
        Some(Complex::new(re, im))
    }

    /// Returns the numbers of the shader's struct `Shape`. The caller passes the places of phasors, schedule and table.
    pub(super) fn shape(
        &self,
        sizes: &MachineShape,
        terms: u32,
        [phasors, schedule, table]: [u32; 3],
    ) -> [u32; SHAPE] {
        let machine = self.system.machine();
        let elements = self.system.sliding_rates().len() as u32;
        let mut shape = [0; SHAPE];
        shape[..11].copy_from_slice(&[
            self.steps,
            phasors,
            schedule,
            table,
            machine.schedule.len() as u32,
            elements,
            machine.degrees() as u32,
            sizes.coordinates,
            sizes.dim() as u32,
            sizes.width() as u32,
            terms,
        ]);
        for (place, drive) in shape[11..19].iter_mut().zip(&machine.drives) {
            *place = drive.order;
        }
        for gap in 0..machine.gaps.len() {
            for side in Side::BOTH {
                let walls = &machine.gaps[gap].walls[side.index()];
                shape[19 + 2 * gap + side.index()] = walls.len() as u32;
                shape[25 + 2 * gap + side.index()] = match walls.last().map(|wall| wall.contact) {
                    None => 0,
                    Some(Contact::Impact) => 3,
                    Some(Contact::Rigid) => 4,
                    Some(_) if self.system.is_pushing(gap, side) => 2,
                    Some(_) => 1,
                };
            }
        }
        shape
    }

    /// Returns the phasors of the grid: cosine and sine of each harmonic at each step.
    pub(super) fn phasors(&self, shape: &MachineShape) -> Vec<f64> {
        let drives = &self.system.machine().drives;
        let turn = std::f64::consts::TAU / f64::from(self.steps);
        let of_step = |step: u32| {
            (0..shape.harmonics as usize).flat_map(move |m| {
                let order = drives.get(m).map_or(0, |drive| drive.order);
                let (sin, cos) = (turn * f64::from(step * order % self.steps)).sin_cos();
                [cos, sin]
            })
        };
        (0..=self.steps).flat_map(of_step).collect()
    }

    /// Returns the orders of the harmonics and the number of steps. Machines that agree in these share their phasors.
    pub(super) fn grid(&self) -> (u32, Vec<u32>) {
        (self.steps, self.system.machine().drives.iter().map(|drive| drive.order).collect())
    }

    /// Returns the changes of the stage: step of the grid, fraction of the next step, and stage.
    pub(super) fn schedule(&self) -> Vec<f64> {
        let of_change = |&(turns, stage): &(f64, usize)| {
            let steps = turns * f64::from(self.steps);
            [steps.floor(), steps.fract(), stage as f64]
        };
        self.system.machine().schedule.iter().flat_map(of_change).collect()
    }

    /// Returns the law of the last walls: restitution and mesh speed, right and left wall of each gap.
    pub(super) fn law(&self) -> [f64; LAW] {
        let mut law = [0.0; LAW];
        for (gap, row) in self.system.machine().gaps.iter().enumerate() {
            for side in Side::BOTH {
                if let Some(wall) = row.walls[side.index()].last() {
                    let at = 4 * (2 * gap + side.index());
                    let [constant, factor, power] = wall.restitution.terms();
                    law[at..at + 4].copy_from_slice(&[constant, factor, power, wall.mesh_speed]);
                }
            }
        }
        law
    }

    /// Returns the table.
    pub(super) fn table(&self, shape: &MachineShape) -> Vec<f64> {
        let system = &self.system;
        let (n, size, width) = (self.degrees(), shape.coordinates as usize, shape.width());
        let mut table = vec![0.0; shape.table(self.tables.equations.len())];
        let mobility = system.mobilities();
        for i in 0..size {
            for j in 0..size {
                let value = if i < n && j < n { mobility[i * n + j] } else { f64::from(u8::from(i == j)) };
                table[shape.place("AT_MOBILITY") + i * size + j] = value;
            }
        }
        for (form, matrix) in system.energy_forms().iter().enumerate() {
            for (k, value) in matrix.iter().enumerate() {
                table[shape.place("AT_ENERGY") + (form * size + k / n) * size + k % n] = *value;
            }
        }
        let most_walls = shape.walls as usize;
        for (gap, row) in system.machine().gaps.iter().enumerate() {
            for side in 0..2 {
                for (nth, wall) in row.walls[side].iter().enumerate() {
                    let place = (2 * gap + side) * most_walls + nth;
                    table[shape.place("AT_WALLS") + place] = wall.at;
                    for (stage, spring) in wall.springs.iter().enumerate() {
                        let all = stage * 2 * shape.gaps as usize * most_walls + place;
                        let at = shape.place("AT_SPRINGS") + 3 * all;
                        table[at..at + 3].copy_from_slice(&[
                            spring.stiffness,
                            spring.damping,
                            spring.force_at_wall(),
                        ]);
                    }
                }
            }
        }
        // Writes a row, which has the machine's own sizes, at a place of the table.
        let put = |table: &mut [f64], at: usize, row: &[f64]| {
            let harmonics = row.len() - 2 * n - 1;
            table[at..at + 2 * n].copy_from_slice(&row[..2 * n]);
            let drives = at + shape.dim();
            table[drives..drives + harmonics].copy_from_slice(&row[2 * n..2 * n + harmonics]);
            table[at + width - 1] = row[row.len() - 1];
        };
        for (i, (row, force)) in system.sliding_rates().iter().enumerate() {
            let at = shape.place("AT_ELEMENTS") + i * (width + 1);
            put(&mut table, at, row);
            table[at + width] = *force;
        }
        for (number, equations) in self.tables.equations.iter().enumerate() {
            let domain = shape.place("AT_DOMAINS") + number * shape.domain();
            let place = |name: &str| domain + shape.place(name);
            table[domain] = equations.radian.min(LONGEST_STEP);
            for (gap, push) in equations.pushes.iter().enumerate() {
                table[place("IN_DOMAIN_STILL") + gap] = f64::from(u8::from(equations.is_still[gap]));
                if let Some(row) = push {
                    table[place("IN_DOMAIN_HAS_PUSH") + gap] = 1.0;
                    put(&mut table, place("IN_DOMAIN_PUSHES") + gap * width, row);
                }
            }
            for (i, hold) in equations.holds.iter().enumerate() {
                if let Some(row) = hold {
                    table[place("IN_DOMAIN_HAS_HOLD") + i] = 1.0;
                    put(&mut table, place("IN_DOMAIN_HOLDS") + i * width, row);
                }
            }
            for (i, row) in equations.accelerations.iter().enumerate() {
                put(&mut table, place("IN_DOMAIN_ACCELERATIONS") + i * width, row);
            }
        }
        table
    }

    /// Returns a start: the state in the coordinates of lanes, and the packed modes.
    pub(super) fn start(&self, state: State, dim: usize) -> Vec<f64> {
        let modes: StartModes = self.system.start(&state);
        let mut start = modes.state[..dim].to_vec();
        let packed = |bits: u32, numbers: &[u32]| {
            numbers.iter().zip(0..).map(|(number, i)| number << (bits * i)).fold(0, |all, one| all | one)
        };
        let of_gaps = |bits: u32, numbers: &[u32]| packed(bits, &numbers[..MOST_GAPS]);
        let [sides, orders] = [modes.walls.map(|(side, _)| side), modes.walls.map(|(_, order)| order)];
        let packs = [
            of_gaps(5, &modes.gaps) | packed(2, &modes.slips) << 15,
            // The stage is here so that f32 holds each number exactly.
            of_gaps(2, &modes.origins) | of_gaps(2, &sides) << 6 | modes.stage << 12,
            of_gaps(3, &orders) | of_gaps(3, &modes.from_force) << 9 | packed(3, &modes.from_rate) << 18,
        ];
        start.extend(packs.map(f64::from));
        let begins_now = self.system.machine().schedule.first().is_some_and(|change| change.0 == 0.0);
        start.push(f64::from(u8::from(begins_now)));
        start
    }

    /// Converts a lane's state to a state of the model.
    pub(super) fn to_state(&self, strobe: &[f64]) -> State {
        self.system.state_of(strobe)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model_file::FileModel;
    use rattlemap_dynamics::model::Model;

    /// Derives the tables of these frequencies in turn, in a new thread, and returns the last one.
    fn table(frequencies: &'static [f64]) -> Vec<f64> {
        let derive = || {
            let mut model = FileModel::built_in("friction-oscillator").unwrap();
            let all = frequencies.iter().map(|&omega| {
                model.set("omega", omega).unwrap();
                let oscillator = model.oscillator().unwrap();
                MachineConstants::new(&oscillator, 8).table(&MachineShape::of(&oscillator))
            });
            all.last().unwrap()
        };
        std::thread::spawn(derive).join().unwrap()
    }

    #[test]
    fn a_table_does_not_depend_on_the_cell_that_needs_it_first() {
        assert_eq!(table(&[1e6, 2.0]), table(&[2.0]));
    }
}
