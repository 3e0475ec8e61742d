//! Tables on the device that lanes share: flows and contact laws.

use std::collections::HashMap;
use std::sync::Arc;

use bytemuck::Zeroable;

use super::constants::Constants;
use super::features::Features;
use super::guard::with_error_scopes;
use super::layout::{self, Flow, FlowShape, contact_code};
use super::machine::{self, MachineShape};
use super::pair::{Change, PAIRS_PER_HARMONIC, phasors as phasors_of};
use super::precision::Precision;
use super::shader::terms_of;
use super::transfer::{buffer, reals, upload};
use super::{Gpu, GpuError};
use rattlemap_dynamics::model::{Form, Law};

/// Flows and laws, uploaded once for any number of runs.
pub struct Tables {
    /// Constants by flow; `None` for a flow that lanes cannot carry.
    pub(super) constants: Vec<Option<Constants>>,
    /// Whether each law is the same at both walls.
    pub(super) is_even: Vec<bool>,
    /// The different sets of features of flows, each with the first flow that has it.
    pub(super) features: Vec<(usize, Features)>,
    /// The first stage of each flow, followed by the further stages of all flows.
    pub(super) flows: wgpu::Buffer,
    pub(super) shapes: wgpu::Buffer,
    /// Zeros for missing harmonics; phasors of the first harmonic; constants of the higher harmonics; changes of stages.
    pub(super) pairs: wgpu::Buffer,
    pub(super) laws: wgpu::Buffer,
}

/// Largest number of copies of all constants during an upload: the host's copy in f64, its copy in the lanes' precision, the driver's, and
/// the device's if it shares the host's memory.
pub(crate) const COPIES: u64 = 4;

/// Number of flows whose constants are rounded and given to the driver at a time, so that the same memory is used again.
const FLOWS_AT_A_TIME: usize = 1024;

/// Largest number of flows, and of bytes of their constants, in one upload if several uploads are needed. This number of lanes keeps
/// hardware busy.
pub(crate) const MOST_FLOWS: usize = 1 << 16;
pub(crate) const MOST_BYTES: u64 = 1 << 30;

/// Returns the largest number of bytes of memory for the constants of one flow, and for the phasors of its steps. Flows with equal steps
/// share the phasors.
pub(crate) fn bytes(oscillator: impl Into<Form>, steps: Option<u32>) -> [u64; 2] {
    let phasors = steps.map_or(0, |steps| u64::from(steps) + 1);
    let oscillator = match oscillator.into() {
        Form::Pair(pair) => pair,
        Form::Machine(machine) => {
            let table = size_of::<Constants>() + machine::bytes(&machine);
            return [COPIES * table as u64, COPIES * 16 * 8 * phasors];
        }
    };
    let pair = size_of::<[f64; 2]>();
    let stage = size_of::<Constants>()
        + size_of::<FlowShape>()
        + PAIRS_PER_HARMONIC * pair * oscillator.harmonics.len();
    let flow = stage * oscillator.stage_count() + 2 * pair * oscillator.schedule.len();
    [flow as u64, phasors * pair as u64].map(|bytes| COPIES * bytes)
}

/// Returns the pairs that describe a change of the stage: whole free steps and the fraction of the next one, and the flow
/// that begins.
fn pairs_of(change: &Change, flow: u32, precision: Precision) -> [[f64; 2]; 2] {
    // Keeps the fraction below 1 when it is rounded.
    let rounding = match precision {
        Precision::F32 => f64::from(f32::EPSILON),
        Precision::F64 => f64::EPSILON,
    };
    [[f64::from(change.step), change.theta.min(1.0 - 0.5 * rounding)], [f64::from(flow), 0.0]]
}

impl Tables {
    /// Returns the free steps per forcing period of a flow; 0 if lanes cannot carry it.
    pub fn steps_per_period(&self, flow: u32) -> u32 {
        self.constants[flow as usize].as_ref().map_or(0, |constants| constants.steps)
    }

    /// Returns the bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        [&self.flows, &self.shapes, &self.pairs, &self.laws].map(wgpu::Buffer::size).iter().sum()
    }

    /// Returns the vector of the constants, whose memory the next tables use again.
    pub(crate) fn into_constants(self) -> Vec<Option<Constants>> {
        self.constants
    }

    /// Returns the constants of each flow; `None` for a flow that lanes cannot carry.
    pub fn constants(&self) -> &[Option<Constants>] {
        &self.constants
    }

    pub(super) async fn new(
        gpu: &Gpu,
        constants: Vec<Option<Constants>>,
        laws: &[Law],
    ) -> Result<Tables, GpuError> {
        if let Some(shape) = machine_shape(&constants) {
            return Tables::of_machines(gpu, constants, laws, shape).await;
        }
        let flows = constants.len();
        let mut shapes = Vec::with_capacity(flows);
        // Further stages follow the first ones of all flows.
        let mut further = Vec::new();
        let mut pairs = vec![[0.0; 2]; PAIRS_PER_HARMONIC];
        // Flows with equal steps share their phasors.
        let mut places = HashMap::new();
        let mut features: Vec<(usize, Features)> = Vec::new();
        for (i, constants) in constants.iter().enumerate() {
            // Lanes of a missing flow are refused before they start.
            let Some((constants, pair)) = constants.as_ref().and_then(|c| Some((c, c.pair()?))) else {
                shapes.push(FlowShape { steps: 1, ..FlowShape::zeroed() });
                continue;
            };
            let place = *places.entry(constants.steps).or_insert_with_key(|&steps| {
                let place = pairs.len() as u32;
                pairs.extend(phasors_of(steps));
                place
            });
            let schedule = pairs.len() as u32;
            let first = flows + further.len() - 1;
            let flow_of = |stage: usize| if stage == 0 { i as u32 } else { (first + stage) as u32 };
            let of_change = |change| pairs_of(change, flow_of(change.stage), gpu.precision);
            pairs.extend(pair.changes.iter().flat_map(of_change));
            let mut shape = |harmonics: &[[f64; 2]]| {
                let place_of_harmonics = pairs.len() as u32;
                pairs.extend(harmonics);
                FlowShape {
                    steps: constants.steps,
                    phasors: place,
                    must_rest: pair.must_rest.into(),
                    degrees: constants.degrees,
                    contacts: pair.contacts.map(contact_code),
                    harmonics: place_of_harmonics,
                    harmonic_count: (harmonics.len() / PAIRS_PER_HARMONIC) as u32,
                    schedule,
                    changes: pair.changes.len() as u32,
                }
            };
            shapes.push(shape(&pair.harmonics));
            further.extend(pair.further.iter().map(|(flow, harmonics)| (*flow, shape(harmonics))));
            if features.iter().all(|(_, others)| *others != constants.features) {
                features.push((i, constants.features));
            }
        }
        pairs.push([1.0, 0.0]);
        shapes.extend(further.iter().map(|(_, shape)| shape));
        let law = |law: &Law| layout::Law { restitution: law.restitution, mesh_speed: law.mesh_speed };
        let rows: Vec<layout::Law> = laws.iter().map(law).collect();
        let pairs = reals(&pairs, gpu.precision);
        let flow_size = size_of::<Flow>() / size_of::<f64>() * gpu.precision.bytes();
        let allowed = gpu.device.limits().max_storage_buffer_binding_size;
        let needed = (shapes.len() * flow_size).max(pairs.len()) as u64;
        if needed > allowed {
            return Err(GpuError::TooManyFlows { flows, needed, allowed });
        }
        let make = || Tables {
            flows: upload_flows(gpu, &constants, &further, flow_size),
            shapes: upload(gpu, "shapes", bytemuck::cast_slice(&shapes)),
            pairs: upload(gpu, "pairs", &pairs),
            laws: upload(gpu, "laws", &reals(&rows, gpu.precision)),
            constants,
            is_even: laws.iter().map(Law::is_symmetric).collect(),
            features,
        };
        with_error_scopes(gpu, "flows", flows, make).await
    }
}

impl Tables {
    /// Uploads machines. Those that differ in frequency and laws alone share one table.
    async fn of_machines(
        gpu: &Gpu,
        constants: Vec<Option<Constants>>,
        laws: &[Law],
        shape: MachineShape,
    ) -> Result<Tables, GpuError> {
        let count = constants.len();
        let (mut flows, mut shapes, mut table) = (Vec::new(), Vec::new(), Vec::new());
        // Each machine has a law for each of its walls.
        let mut of_flows = Vec::new();
        let (mut grids, mut machines) = (HashMap::new(), HashMap::new());
        let mut features: Vec<(usize, Features)> = Vec::new();
        for (i, constants) in constants.iter().enumerate() {
            let Some((constants, machine)) = constants.as_ref().and_then(|c| Some((c, c.machine()?))) else {
                // Lanes of a missing flow are refused before they start.
                flows.extend([0.0; machine::FLOW]);
                shapes.extend([1; machine::SHAPE]);
                of_flows.extend([0.0; machine::LAW]);
                continue;
            };
            let mut add = |numbers: Vec<f64>| {
                let place = table.len() as u32;
                table.extend(numbers);
                place
            };
            let phasors = *grids.entry(machine.grid()).or_insert_with(|| add(machine.phasors(&shape)));
            let own =
                *machines.entry(Arc::as_ptr(machine.shared())).or_insert_with(|| add(machine.table(&shape)));
            let schedule = add(machine.schedule());
            flows.extend(machine.flow());
            shapes.extend(machine.shape(&shape, terms_of(gpu.precision), [phasors, schedule, own]));
            of_flows.extend(machine.law());
            let of_table = Features { machine: Some(shape), ..constants.features };
            if features.iter().all(|(_, others)| *others != of_table) {
                features.push((i, of_table));
            }
        }
        table.push(0.0);
        let [flows, table, rows] = [flows, table, of_flows].map(|numbers| reals(&numbers, gpu.precision));
        let allowed = gpu.device.limits().max_storage_buffer_binding_size;
        let needed = table.len().max(flows.len()).max(4 * shapes.len()).max(rows.len()) as u64;
        if needed > allowed {
            return Err(GpuError::TooManyFlows { flows: count, needed, allowed });
        }
        let make = || Tables {
            flows: upload(gpu, "flows", &flows),
            shapes: upload(gpu, "shapes", bytemuck::cast_slice(&shapes)),
            pairs: upload(gpu, "machines", &table),
            laws: upload(gpu, "laws", &rows),
            constants,
            is_even: laws.iter().map(Law::is_symmetric).collect(),
            features,
        };
        with_error_scopes(gpu, "flows", count, make).await
    }
}

/// Returns sizes that suffice for all machines; `None` if the flows are pairs.
fn machine_shape(constants: &[Option<Constants>]) -> Option<MachineShape> {
    constants.iter().flatten().filter_map(|constants| constants.features.machine).reduce(MachineShape::and)
}

/// Rounds the constants of flows and uploads them; further stages follow all first stages. `size` is the size of a flow in the lanes'
/// precision.
fn upload_flows(
    gpu: &Gpu,
    constants: &[Option<Constants>],
    further: &[(Flow, FlowShape)],
    size: usize,
) -> wgpu::Buffer {
    let count = constants.len();
    let (buffer, none) = (buffer(gpu, "flows", (count + further.len()) * size), Flow::zeroed());
    for (n, part) in constants.chunks(FLOWS_AT_A_TIME).enumerate() {
        let flows = part
            .iter()
            .map(|constants| constants.as_ref().and_then(Constants::pair).map_or(&none, |c| &c.flow));
        gpu.write(&buffer, (n * FLOWS_AT_A_TIME * size) as u64, &reals(flows, gpu.precision));
    }
    for (n, part) in further.chunks(FLOWS_AT_A_TIME).enumerate() {
        let flows = part.iter().map(|(flow, _)| flow);
        gpu.write(&buffer, ((count + n * FLOWS_AT_A_TIME) * size) as u64, &reals(flows, gpu.precision));
    }
    buffer
}
