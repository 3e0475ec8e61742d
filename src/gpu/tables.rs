//! Tables on the device that lanes share: flows and contact laws.

use super::constants::Constants;
use super::guard::with_error_scopes;
use super::layout::{self, Flow, FlowShape, contact_code};
use super::transfer::{reals, upload};
use super::{Gpu, GpuError};
use rattlemap_dynamics::model::{Law, Oscillator};

/// Flows and laws, uploaded once for any number of runs.
pub struct Tables {
    /// Constants by flow; `None` for a flow that lanes cannot carry.
    pub(super) constants: Vec<Option<Constants>>,
    /// Whether each law is the same at both walls.
    pub(super) is_even: Vec<bool>,
    /// Index of a flow with an elastic or a rigid wall, if there is one.
    pub(super) flow_of_another_kind: Option<usize>,
    /// The first flow whose force has a sine.
    pub(super) flow_with_sine: Option<usize>,
    pub(super) flows: wgpu::Buffer,
    pub(super) shapes: wgpu::Buffer,
    pub(super) phasors: wgpu::Buffer,
    pub(super) laws: wgpu::Buffer,
}

/// Copies of all constants during an upload: the lanes' constants, the lists of flows and phasors, these lists in the
/// lanes' precision, the driver's copy, and the device's copy if it shares the host's memory.
pub(crate) const COPIES: u64 = 5;

/// Most flows that are uploaded at a time if there are too many for one upload, and most bytes that their constants
/// then take. So many lanes keep hardware busy.
pub(crate) const MOST_FLOWS: usize = 1 << 16;
pub(crate) const MOST_BYTES: u64 = 1 << 30;

/// Returns the most bytes of memory that the constants of one flow take.
pub(crate) fn bytes(oscillator: &Oscillator, steps_per_period: Option<u32>) -> u64 {
    let steps = Constants::steps(oscillator, steps_per_period);
    let phasors = steps.map_or(0, |steps| (u64::from(steps) + 1) * size_of::<[f64; 2]>() as u64);
    COPIES * (size_of::<Constants>() as u64 + size_of::<FlowShape>() as u64 + phasors)
}

impl Tables {
    /// Returns the free steps per forcing period of a flow; 0 if lanes cannot carry it.
    pub fn steps_per_period(&self, flow: u32) -> u32 {
        self.constants[flow as usize].as_ref().map_or(0, |constants| constants.steps)
    }

    /// Returns the bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        [&self.flows, &self.shapes, &self.phasors, &self.laws].map(wgpu::Buffer::size).iter().sum()
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
        let flows = constants.len();
        let mut tables: Vec<Flow> = Vec::with_capacity(flows);
        let mut shapes = Vec::with_capacity(flows);
        let mut phasors = Vec::new();
        for constants in &constants {
            match constants {
                Some(constants) => {
                    shapes.push(FlowShape {
                        steps: constants.steps,
                        phasors: phasors.len() as u32,
                        must_rest: constants.must_rest.into(),
                        degrees: constants.degrees,
                        contacts: constants.contacts.map(contact_code),
                    });
                    tables.push(constants.flow);
                    phasors.extend_from_slice(&constants.phasors);
                }
                // Lanes of this flow are refused before they start.
                None => {
                    shapes.push(FlowShape { steps: 1, ..bytemuck::Zeroable::zeroed() });
                    tables.push(bytemuck::Zeroable::zeroed());
                }
            }
        }
        phasors.push([1.0, 0.0]);
        let law = |law: &Law| layout::Law { restitution: law.restitution, mesh_speed: law.mesh_speed };
        let rows: Vec<layout::Law> = laws.iter().map(law).collect();
        let tables = reals(&tables, gpu.precision);
        let phasors = reals(&phasors, gpu.precision);
        let allowed = gpu.device.limits().max_storage_buffer_binding_size;
        let needed = tables.len().max(phasors.len()) as u64;
        if needed > allowed {
            return Err(GpuError::TooManyFlows { flows, needed, allowed });
        }
        let first = |has: fn(&Constants) -> bool| constants.iter().position(|c| c.as_ref().is_some_and(has));
        let flow_of_another_kind = first(|c| c.has_elastic_or_rigid_wall);
        let flow_with_sine = first(|c| c.has_sine);
        let make = || Tables {
            flows: upload(gpu, "flows", &tables),
            shapes: upload(gpu, "shapes", bytemuck::cast_slice(&shapes)),
            phasors: upload(gpu, "phasors", &phasors),
            laws: upload(gpu, "laws", &reals(&rows, gpu.precision)),
            constants,
            is_even: laws.iter().map(Law::is_symmetric).collect(),
            flow_of_another_kind,
            flow_with_sine,
        };
        with_error_scopes(gpu, "flows", flows, make).await
    }
}
