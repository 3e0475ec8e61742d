//! The linear domains of a machine.
//!
//! The state is `y = (x, v, 1, cos and sin of each harmonic)`, so that every domain is `y' = A y`. A domain is built on first use.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use nalgebra::{DMatrix, DVector, RowDVector};
use rattlemap_dynamics::model::{Contact, DryFriction, NonlinearSpring, Oscillator, Side};

/// A step, in radians of the fastest rate.
pub(crate) const ANGLE: f64 = 0.6;

/// Terms of Taylor series: `0.6^19 / 19!` is far below rounding.
const TERMS: usize = 18;

/// Relative size below which numbers count as rounding errors.
pub(crate) const ROUNDING: f64 = 1e-12;

pub(crate) type Vector = DVector<f64>;
pub(crate) type Functional = RowDVector<f64>;
pub(crate) type Matrix = DMatrix<f64>;

/// The mode of an element with dry friction: it sticks, or slides with a positive or a negative rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Grip {
    Stick,
    Plus,
    Minus,
}

impl Grip {
    pub(crate) fn sign(self) -> f64 {
        [0.0, 1.0, -1.0][self as usize]
    }
}

/// The modes that distinguish the domains of a machine.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Key {
    pub(crate) stage: usize,
    /// Number of walls of each gap whose springs act: on the right if positive, on the left if negative.
    pub(crate) acting: Vec<i8>,
    /// Gaps at rest on rigid walls.
    pub(crate) held: Vec<bool>,
    pub(crate) grips: Vec<Grip>,
    /// Numbers of points that the arguments of curves have passed.
    pub(crate) passed: Vec<usize>,
}

/// A force that is linear between points: of friction as a function of the size of the sliding rate, or of a nonlinear spring.
pub(crate) struct Curve {
    pub(crate) points: Vec<[f64; 2]>,
    /// Slopes in front of the first point and beyond the last one.
    slopes: [f64; 2],
    /// Row of the argument, for friction that slides forwards.
    pub(crate) argument: Functional,
    /// Gap and side of the wall with which the spring acts.
    pub(crate) wall: Option<(usize, Side)>,
    /// Least number of passed points: friction and walls have no force in front of the first point.
    pub(crate) least: usize,
}

impl Curve {
    /// Returns slope and force at 0 of the line beyond a number of passed points.
    fn line(&self, passed: usize) -> [f64; 2] {
        let points = &self.points;
        let slope = match passed {
            0 => self.slopes[0],
            last if last == points.len() => self.slopes[1],
            inner => (points[inner][1] - points[inner - 1][1]) / (points[inner][0] - points[inner - 1][0]),
        };
        let [at, force] = points[passed.saturating_sub(1)];
        [slope, force - slope * at]
    }

    /// Returns the number of points that an argument has passed.
    pub(crate) fn passed(&self, argument: f64) -> usize {
        self.points.iter().filter(|point| point[0] < argument).count().max(self.least)
    }

    /// Whether the force pulls somewhere, or would do so beyond the last point.
    fn may_pull(&self) -> bool {
        self.slopes[1] < 0.0 || self.points.iter().any(|point| point[1] < 0.0)
    }
}

/// One linear domain. Rows are applied to the state `y`.
pub(crate) struct Linear {
    pub(crate) a: Matrix,
    /// Length of a step and its exponential.
    pub(crate) step: (f64, Matrix),
    /// Time in which the fastest rate turns by one radian.
    pub(crate) radian: f64,
    /// Accelerations of the gaps. They are 0 for gaps at rest.
    pub(crate) acceleration: Vec<Functional>,
    /// For each gap at rest on a rigid wall, its acceleration if this wall were absent and everything else at rest stayed at rest.
    pub(crate) pressing: Vec<Functional>,
    /// Forces that make elements stick.
    pub(crate) hold: Vec<Functional>,
    /// Elements that stick without a force, because walls hold their row.
    pub(crate) is_idle: Vec<bool>,
    /// Elements that slide at a rate which others at rest keep constant.
    pub(crate) is_driven: Vec<bool>,
    /// Gaps at rest that no rigid wall holds: friction holds them.
    pub(crate) is_still: Vec<bool>,
}

impl Linear {
    /// Returns the coefficients of the state as a polynomial of the share of a step.
    pub(crate) fn series(&self, y: &Vector, h: f64) -> Vec<Vector> {
        let mut terms = vec![y.clone()];
        for k in 1..=TERMS {
            let mut next = Vector::zeros(y.len());
            next.gemv(h / k as f64, &self.a, &terms[k - 1], 0.0);
            terms.push(next);
        }
        terms
    }

    /// Returns the sign of the first derivative of `row y` that exceeds rounding errors, beginning with the value itself; 0 if there is
    /// none.
    pub(crate) fn tendency(&self, row: &Functional, y: &Vector) -> f64 {
        let mut row = row.clone();
        for _ in 0..4 {
            let value = value(&row, y);
            let size: f64 = row.iter().zip(y.iter()).map(|(a, b)| (a * b).abs()).sum();
            if value.abs() > ROUNDING * size {
                return value.signum();
            }
            row = &row * &self.a;
        }
        0.0
    }
}

pub(crate) fn value(row: &Functional, y: &Vector) -> f64 {
    row.iter().zip(y.iter()).map(|(a, b)| a * b).sum()
}

/// Returns the exponential of a matrix by scaling and squaring of its series.
pub(crate) fn exponential(a: &Matrix) -> Matrix {
    let size = norm(a);
    let doublings = (2.0 * size).log2().ceil().max(0.0) as i32;
    let small = a * 2f64.powi(-doublings);
    let one = Matrix::identity(a.nrows(), a.nrows());
    let mut sum = (1..=18).rev().fold(one.clone(), |sum, k| &one + product(&small, &sum) / f64::from(k));
    for _ in 0..doublings {
        sum = product(&sum, &sum);
    }
    sum
}

/// Returns the product of two matrices, column by column. In test builds, the product of nalgebra is not optimised.
pub(crate) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let mut all = Matrix::zeros(a.nrows(), b.ncols());
    for (mut column, b) in all.column_iter_mut().zip(b.column_iter()) {
        for (a, &b) in a.column_iter().zip(b.iter()).filter(|(_, b)| **b != 0.0) {
            column.axpy(b, &a, 1.0);
        }
    }
    all
}

/// Returns unit vectors that span the vectors which all matrices map to 0.
fn null_space(matrices: &[Matrix]) -> Vec<Vector> {
    let scaled = matrices.iter().filter(|m| m.amax() > 0.0).map(|m| m.transpose() * m / m.amax().powi(2));
    let eigen = scaled.reduce(|a, b| a + b).expect("a matrix").symmetric_eigen();
    let small = (0..eigen.eigenvalues.len()).filter(|&i| eigen.eigenvalues[i].abs() < 1e-14);
    small.map(|i| eigen.eigenvectors.column(i).into_owned()).collect()
}

/// Returns the largest sum of the entries' sizes in a row.
fn norm(a: &Matrix) -> f64 {
    a.row_iter().map(|row| row.abs().sum()).fold(0.0, f64::max)
}

/// The change of velocities by an impulse along a row that changes the row's rate by 1 while earlier rows are held, and this impulse. Both
/// are 0 if the earlier rows hold the row.
pub(crate) type Bond = (Vector, f64);

/// A machine with its domains.
pub(crate) struct System {
    pub(crate) machine: Oscillator,
    pub(crate) degrees: usize,
    pub(crate) period: f64,
    /// The length that the limit of short flights is relative to.
    pub(crate) length: f64,
    pub(crate) per_mass: Matrix,
    /// Unit vectors along which nothing holds the machine to the ground, and those along which nothing damps it, either.
    pub(crate) shifts: Vec<Vector>,
    pub(crate) conserved: usize,
    /// Rows of the gaps and of their rates.
    pub(crate) z: Vec<Functional>,
    pub(crate) w: Vec<Functional>,
    /// Rows of the sliding rates.
    pub(crate) slides: Vec<Functional>,
    /// Forces of friction, then of nonlinear springs.
    pub(crate) curves: Vec<Curve>,
    angle: f64,
    domains: RefCell<HashMap<Key, Rc<Linear>>>,
}

impl System {
    /// Builds the system with steps of `angle` radians of the fastest rate.
    pub(crate) fn new(machine: &Oscillator, angle: f64) -> System {
        let mut machine = machine.clone();
        machine
            .friction
            .retain(|one| one.static_force > 0.0 || one.at_speed.iter().any(|point| point[1] > 0.0));
        let degrees = machine.degrees();
        let mut system = System {
            degrees,
            period: machine.period(),
            length: machine.length_scale(),
            per_mass: machine.mass.clone().try_inverse().expect("a mass matrix"),
            shifts: Vec::new(),
            conserved: 0,
            z: Vec::new(),
            w: Vec::new(),
            slides: Vec::new(),
            curves: Vec::new(),
            angle,
            domains: RefCell::default(),
            machine,
        };
        let rows = |at| system.machine.gaps.iter().map(|gap| system.row(&gap.row, at)).collect();
        let (z, w) = (rows(0), rows(degrees));
        let slide = |friction: &DryFriction| {
            let mut row = system.row(&friction.row, degrees);
            row[2 * degrees] = -friction.speed;
            row
        };
        let slides: Vec<Functional> = system.machine.friction.iter().map(slide).collect();
        let friction = system.machine.friction.iter().zip(&slides).map(|(friction, row)| Curve {
            points: [[0.0, friction.force]].iter().chain(&friction.at_speed).copied().collect(),
            slopes: [0.0; 2],
            argument: row.clone(),
            wall: None,
            least: 1,
        });
        let springs = system.machine.springs.iter().map(|NonlinearSpring { row, points, wall }| {
            let slope = |[a, b]: [usize; 2]| (points[b][1] - points[a][1]) / (points[b][0] - points[a][0]);
            let slopes = [[0, 1], [points.len() - 2, points.len() - 1]].map(slope);
            let (argument, least) = (system.row(row, 0), usize::from(wall.is_some()));
            Curve { points: points.clone(), slopes, argument, wall: *wall, least }
        });
        let curves = friction.chain(springs).collect();
        (system.z, system.w, system.slides, system.curves) = (z, w, slides, curves);
        let as_row = |row: &Vector| Matrix::from_rows(&[row.transpose()]);
        let stages = || system.machine.stages.iter();
        let mut held: Vec<Matrix> = stages().map(|forces| forces.stiffness.clone()).collect();
        let with_walls = system.machine.gaps.iter().filter(|gap| gap.walls != [vec![], vec![]]);
        held.extend(with_walls.map(|gap| as_row(&gap.row)));
        held.extend(system.machine.springs.iter().map(|spring| as_row(&spring.row)));
        let mut damped = held.clone();
        damped.extend(stages().flat_map(|forces| [forces.damping.clone(), forces.damping.transpose()]));
        damped.extend(system.machine.friction.iter().map(|friction| as_row(&friction.row)));
        (system.shifts, system.conserved) = (null_space(&held), null_space(&damped).len());
        system
    }

    /// Returns the number of entries of `y`.
    pub(crate) fn size(&self) -> usize {
        2 * self.degrees + 1 + 2 * self.machine.drives.len()
    }

    /// Returns the row of a combination of entries from `at` on.
    fn row(&self, along: &Vector, at: usize) -> Functional {
        let mut row = Functional::zeros(self.size());
        row.columns_mut(at, self.degrees).copy_from(&along.transpose());
        row
    }

    /// Returns the row of the force, positive away from the wall, of spring, damper, preload and curve behind a wall that only pushes.
    /// There is none if this force cannot pull behind the wall.
    pub(crate) fn pushing(
        &self,
        gap: usize,
        side: Side,
        nth: usize,
        stage: usize,
        passed: &[usize],
    ) -> Option<Functional> {
        let wall = &self.machine.gaps[gap].walls[side.index()][nth];
        let spring = &wall.springs[stage];
        let curve = self.curves.iter().zip(passed).find(|(curve, _)| curve.wall == Some((gap, side)));
        let may_pull = spring.damping != 0.0
            || spring.force_at_wall() != 0.0
            || curve.is_some_and(|(curve, _)| curve.may_pull());
        if wall.contact != Contact::Pushing || !may_pull {
            return None;
        }
        let s = side.sign();
        let mut row = (&self.z[gap] * spring.stiffness + &self.w[gap] * spring.damping) * s;
        row[2 * self.degrees] = spring.force_at_wall() - s * spring.stiffness * wall.at;
        if let Some((curve, &passed)) = curve {
            let [slope, force] = curve.line(passed);
            row += &curve.argument * slope;
            row[2 * self.degrees] += force;
        }
        Some(row)
    }

    /// Returns the bonds of rows of velocities, each while the earlier rows are held.
    pub(crate) fn bonds(&self, rows: &[&Vector]) -> Vec<Bond> {
        let mut mobility = self.per_mass.clone();
        let bond = |row: &&Vector| {
            let change = &mobility * *row;
            let along = row.dot(&change);
            if along <= ROUNDING * row.dot(&(&self.per_mass * *row)) {
                return (Vector::zeros(self.degrees), 0.0);
            }
            mobility -= &change * change.transpose() / along;
            (change / along, 1.0 / along)
        };
        rows.iter().map(bond).collect()
    }

    /// Returns the generator of motion in which rows of velocities are constant.
    fn bound(&self, a: &Matrix, rows: &[&Vector]) -> Matrix {
        let (n, mut a) = (self.degrees, a.clone());
        for (row, (change, _)) in rows.iter().zip(self.bonds(rows)) {
            let rate = row.transpose() * a.rows(n, n);
            let mut accelerations = a.rows_mut(n, n);
            accelerations -= change * rate;
        }
        a
    }

    /// Returns the generator without anything at rest, a bound on its fastest rate, and the fastest rate by singular values.
    fn generator(&self, key: &Key) -> (Matrix, [f64; 2]) {
        let (n, machine) = (self.degrees, &self.machine);
        let forces = &machine.stages[key.stage];
        let (mut stiffness, mut damping) = (forces.stiffness.clone(), forces.damping.clone());
        let mut load = forces.load.clone();
        for (gap, &acting) in machine.gaps.iter().zip(&key.acting) {
            let side = if acting > 0 { Side::Right } else { Side::Left };
            let square = &gap.row * gap.row.transpose();
            for wall in &gap.walls[side.index()][..usize::from(acting.unsigned_abs())] {
                let spring = &wall.springs[key.stage];
                stiffness += &square * spring.stiffness;
                damping += &square * spring.damping;
                load += &gap.row * (spring.stiffness * wall.at - side.sign() * spring.force_at_wall());
            }
        }
        for (i, (friction, grip)) in machine.friction.iter().zip(&key.grips).enumerate() {
            // While sliding, the force has the sign of the rate, and the slope acts on the rate itself.
            let [slope, force] = self.curves[i].line(key.passed[i]).map(|x| x * grip.sign());
            load -= &friction.row * (force - grip.sign() * slope * friction.speed);
            damping += &friction.row * friction.row.transpose() * (grip.sign() * slope);
        }
        let curves = self.curves.iter().zip(&key.passed).skip(machine.friction.len());
        for ((curve, &passed), spring) in curves.zip(&machine.springs) {
            let acts = curve.wall.is_none_or(|(gap, side)| {
                f64::from(key.acting[gap]) * side.sign() == machine.gaps[gap].walls[side.index()].len() as f64
            });
            if acts {
                let [slope, force] = curve.line(passed);
                load -= &spring.row * force;
                stiffness += &spring.row * spring.row.transpose() * slope;
            }
        }
        let mut a = Matrix::zeros(self.size(), self.size());
        a.view_mut((0, n), (n, n)).fill_with_identity();
        let (of_x, of_v) = (&self.per_mass * &stiffness, &self.per_mass * &damping);
        a.view_mut((n, 0), (n, n)).copy_from(&-&of_x);
        a.view_mut((n, n), (n, n)).copy_from(&-&of_v);
        a.view_mut((n, 2 * n), (n, 1)).copy_from(&(&self.per_mass * load));
        for (i, drive) in machine.drives.iter().enumerate() {
            let (cos, sin) = (2 * n + 1 + 2 * i, 2 * n + 2 + 2 * i);
            a.view_mut((n, cos), (n, 1)).copy_from(&(&self.per_mass * &drive.cos));
            a.view_mut((n, sin), (n, 1)).copy_from(&(&self.per_mass * &drive.sin));
            let rate = f64::from(drive.order) * machine.omega;
            (a[(cos, sin)], a[(sin, cos)]) = (-rate, rate);
        }
        let of_force = f64::from(machine.highest_order()) * machine.omega;
        let factor =
            machine.mass.clone().cholesky().expect("a mass matrix").l().try_inverse().expect("its factor");
        let own = |m: &Matrix| (&factor * m * factor.transpose()).singular_values().max();
        let rates = [norm(&of_x).sqrt() + norm(&of_v), own(&stiffness).sqrt() + own(&damping)];
        (a, rates.map(|rate| rate.max(of_force)))
    }

    pub(crate) fn domain(&self, key: &Key) -> Rc<Linear> {
        if let Some(found) = self.domains.borrow().get(key) {
            return found.clone();
        }
        let built = Rc::new(self.build(key));
        self.domains.borrow_mut().insert(key.clone(), built.clone());
        built
    }

    fn build(&self, key: &Key) -> Linear {
        let (machine, empty) = (&self.machine, Functional::zeros(self.size()));
        let (gaps, elements) = (0..machine.gaps.len(), 0..machine.friction.len());
        let (free, [fastest, rate]) = self.generator(key);
        let held: Vec<usize> = gaps.clone().filter(|&i| key.held[i]).collect();
        let sticking: Vec<usize> = elements.clone().filter(|&i| key.grips[i] == Grip::Stick).collect();
        let gap = |i: usize| &machine.gaps[i].row;
        let along = |i: usize| &machine.friction[i].row;
        let walls: Vec<&Vector> = held.iter().map(|&i| gap(i)).collect();
        // Elements that walls hold are idle.
        let all: Vec<&Vector> = walls.iter().copied().chain(sticking.iter().map(|&i| along(i))).collect();
        let bonds = self.bonds(&all);
        let busy: Vec<usize> =
            (0..sticking.len()).filter(|j| bonds[walls.len() + j].1 > 0.0).map(|j| sticking[j]).collect();
        let rows = |walls: &[usize], sticking: &[usize]| -> Vec<&Vector> {
            walls.iter().map(|&i| gap(i)).chain(sticking.iter().map(|&i| along(i))).collect()
        };
        let others =
            |of: &[usize], i: usize| -> Vec<usize> { of.iter().copied().filter(|&j| j != i).collect() };
        let at_rest = rows(&held, &busy);
        let a = self.bound(&free, &at_rest);
        let is_given = |row: &Vector| {
            let with: Vec<&Vector> = at_rest.iter().copied().chain([row]).collect();
            self.bonds(&with).last().is_some_and(|bond| bond.1 == 0.0)
        };
        let is_driven = |i: usize| key.grips[i] != Grip::Stick && is_given(along(i));
        let mut is_still = vec![false; machine.gaps.len()];
        let mut acceleration: Vec<Functional> = self.w.iter().map(|w| w * &a).collect();
        for i in gaps.clone() {
            if is_given(gap(i)) {
                acceleration[i] = empty.clone();
                is_still[i] = !key.held[i] && !self.moves(gap(i), &held, &busy);
            }
        }
        let pressing = |i: usize| match key.held[i] {
            true => &self.w[i] * self.bound(&free, &rows(&others(&held, i), &busy)),
            false => empty.clone(),
        };
        let hold = |i: usize| {
            if !busy.contains(&i) {
                return empty.clone();
            }
            let before = rows(&held, &others(&busy, i));
            let with: Vec<&Vector> = before.iter().copied().chain([along(i)]).collect();
            let impulse = self.bonds(&with).last().map_or(0.0, |bond| bond.1);
            self.row(along(i), self.degrees) * self.bound(&free, &before) * impulse
        };
        // With few digits, sums of steps have hardly any rounding error.
        let h = f64::from((self.angle / fastest) as f32);
        Linear {
            step: (h, exponential(&(&a * h))),
            radian: 1.0 / rate,
            acceleration,
            pressing: gaps.map(pressing).collect(),
            hold: elements.clone().map(hold).collect(),
            is_idle: elements.clone().map(|i| key.grips[i] == Grip::Stick && !busy.contains(&i)).collect(),
            is_driven: elements.map(is_driven).collect(),
            is_still,
            a,
        }
    }

    /// Whether a gap moves although rows at rest determine its rate, for example on a moving belt.
    fn moves(&self, gap: &Vector, held: &[usize], sticking: &[usize]) -> bool {
        let machine = &self.machine;
        let walls = held.iter().map(|&i| (machine.gaps[i].row.clone(), 0.0));
        let belts = sticking.iter().map(|&i| (machine.friction[i].row.clone(), machine.friction[i].speed));
        let (rows, speeds): (Vec<Vector>, Vec<f64>) = walls.chain(belts).unzip();
        let shares = Matrix::from_columns(&rows).svd(true, true).solve(gap, ROUNDING).expect("factors");
        let speed: f64 = shares.iter().zip(&speeds).map(|(share, speed)| share * speed).sum();
        let size = shares.abs().sum() * speeds.iter().fold(0.0, |most: f64, speed| most.max(speed.abs()));
        speed.abs() > ROUNDING * size
    }
}
