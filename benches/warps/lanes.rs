//! Writes what the simulation of warps needs: the shaders of a map, some of its lanes, and the settings of a dispatch.
//!
//!     cargo run -p rattlemap-bench --example warps -- FOLDER GROUPS LANES SCENE [NAME=VALUE ...]
//!
//! The lanes are GROUPS groups of LANES neighbours in the map's order, evenly spread over it. The tables are those of `src/gpu/tables.rs`.

use std::collections::HashMap;
use std::f64::consts::TAU;
use std::path::Path;

use anyhow::Context;
use rattlemap::gpu::layout::{self, Cell, Flow, FlowShape, Settings};
use rattlemap::gpu::{Constants, Features, LaneSettings, Precision, Tangents, Variant, follows_chatter};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::model::Form;

/// Writes the key of each active lane into a buffer, so that the simulation can sort lanes as the device does.
const KEYS: &str = "
@compute @workgroup_size(WORKGROUP)
fn keys(@builtin(global_invocation_id) id: vec3<u32>) {
    block_starts[id.x] = key_of(id.x);
}
";

// As in src/gpu/layout.rs, src/gpu/pair/constants.rs and src/gpu/averaging.rs.
const PAIRS_PER_HARMONIC: usize = 21;
const EXPONENT_BLOCKS: u32 = 32;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, groups, lanes, scene, sets @ ..] = arguments.as_slice() else {
        anyhow::bail!("usage: warps FOLDER GROUPS LANES SCENE [NAME=VALUE ...]");
    };
    let (groups, lanes): (usize, usize) = (groups.parse()?, lanes.parse()?);
    let text = std::fs::read_to_string(scene).with_context(|| format!("cannot read {scene}"))?;
    let plan = Plan::new(&Scene::parse(&text, scene, sets, Purpose::Map)?);
    let parts = plan.run_count() / lanes;
    let begins = (0..groups).map(|nth| (2 * nth + 1) * parts / (2 * groups) * lanes);
    let picked: Vec<_> = begins.flat_map(|begin| plan.cells(begin..begin + lanes)).collect();

    // Lanes share flows, as in a map. Each has a law of its own.
    let mut known = HashMap::new();
    let (mut flows, mut shapes, mut laws, mut cells, mut starts) = (vec![], vec![], vec![], vec![], vec![]);
    let (mut pairs, mut places) = (vec![[0.0; 2]; PAIRS_PER_HARMONIC], HashMap::new());
    let (mut chatter, mut features) = (false, Features::default());
    for (i, picked) in (0..).zip(&picked) {
        let (form, law) = (plan.form(picked.flow), plan.law(picked.law));
        let constants = Constants::new(form.clone(), None).context("a flow has too many steps")?;
        let (Some(pair), Form::Pair(oscillator)) = (constants.pair(), &form) else {
            anyhow::bail!("machines are not simulated")
        };
        chatter |= law.mesh_speed.iter().any(|&speed| follows_chatter(oscillator, speed));
        features = features.and(Features::of(form.clone()));
        let mirror = (constants.mirror_symmetric && law.is_symmetric()).into();
        laws.push(layout::Law { restitution: law.restitution, mesh_speed: law.mesh_speed });
        starts.push(pair.to_lane(picked.start));
        let flow_index = *known.entry(picked.flow).or_insert(flows.len() as u32);
        cells.push(Cell { flow_index, law_index: i, refused: 0, mirror });
        if (flow_index as usize) < flows.len() {
            continue;
        }
        let phasors = *places.entry(constants.steps).or_insert_with_key(|&steps| {
            let place = pairs.len() as u32;
            let angles = (0..=steps).map(|n| TAU * f64::from(n % steps) / f64::from(steps));
            pairs.extend(angles.map(|angle| [angle.cos(), angle.sin()]));
            place
        });
        let Constants { steps, degrees, .. } = constants;
        shapes.push(FlowShape { steps, phasors, degrees, ..FlowShape::default() });
        flows.push(pair.flow);
    }
    pairs.push([1.0, 0.0]);
    anyhow::ensure!(features == Features::default(), "the tables lack constants of {features:?}");

    let write = |name: &str, bytes: &[u8]| std::fs::write(Path::new(folder).join(name), bytes);
    write("flows.bin", &reals(bytemuck::cast_slice::<Flow, f64>(&flows)))?;
    write("shapes.bin", bytemuck::cast_slice(&shapes))?;
    write("pairs.bin", &reals(bytemuck::cast_slice(&pairs)))?;
    write("laws.bin", &reals(bytemuck::cast_slice(&laws)))?;
    write("cells.bin", bytemuck::cast_slice(&cells))?;
    write("starts.bin", &reals(bytemuck::cast_slice(&starts)))?;
    write("settings.bin", bytemuck::bytes_of(&settings(&plan, cells.len() as u32)))?;
    let variant = Variant { chatter, features, ..Variant::of(Precision::F32) };
    write("shader.wgsl", (variant.source() + KEYS).as_bytes())?;
    let reading = Variant { tangents: Tangents::Columns, ..variant };
    write("reading.wgsl", reading.source().replace("fn sweep(", "fn reading(").as_bytes())?;
    Ok(())
}

/// Returns the settings that `src/gpu/slots.rs` sends to a card. Undecided lanes end after `periods`, and no lane has a warp to itself.
fn settings(plan: &Plan, count: u32) -> Settings {
    let lanes = LaneSettings::within(plan.budget());
    Settings {
        slots: count,
        active_lanes: count,
        periods: lanes.periods,
        decided_by: lanes.periods,
        longest: lanes.periods,
        hands_over: u32::from(lanes.early_stop),
        chaos_from: lanes.chaos_from,
        chaos_errors: lanes.chaos_errors,
        iterations: lanes.iterations,
        passes_per_period: lanes.passes_per_period,
        events_per_period: lanes.events_per_period,
        most_events: lanes.most_events,
        row: count.next_multiple_of(lanes.workgroup),
        transient_periods: lanes.transient_periods.min(lanes.exponent_from),
        exponent_from: lanes.exponent_from,
        exponent_block: (lanes.periods - lanes.exponent_from) / EXPONENT_BLOCKS,
        max_period: lanes.max_period,
        early_stop: u32::from(lanes.early_stop),
        ..Settings::default()
    }
}

/// Returns the bytes of numbers in single precision.
fn reals(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|&number| (number as f32).to_ne_bytes()).collect()
}
