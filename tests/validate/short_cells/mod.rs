//! Random cells of 64 periods, and what lanes say of them. The cells are rows of data/short_cells.csv.

use std::sync::Mutex;

use rattlemap::gpu::{AdapterChoice, Gpu, Precision};
use rattlemap::map::engine::{self, Engine};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::record::Record;
use rattlemap_dynamics::model::{GearPair, State};

const TABLE: &str = include_str!("../data/short_cells.csv");

/// A pair by its parameters in the order of [`GearPair::PARAMETERS`], and its start.
pub(crate) struct Cell(pub(crate) [f64; 13], pub(crate) State);

/// The cells of a group, `count` of them.
#[track_caller]
pub(crate) fn cells(group: &str, count: usize) -> Vec<Cell> {
    let mut lines = TABLE.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert!(GearPair::PARAMETERS.iter().map(|parameter| &*parameter.name).eq(names[1..14].iter().copied()));
    let of_group = lines.filter_map(|line| line.split_once(',').filter(|(name, _)| *name == group));
    let cells: Vec<Cell> = of_group
        .map(|(_, row)| {
            let numbers: Vec<f64> = row.split(',').map(|number| number.parse().unwrap()).collect();
            Cell(numbers[..13].try_into().unwrap(), numbers[13..].try_into().unwrap())
        })
        .collect();
    assert_eq!(cells.len(), count, "{group}");
    cells
}

/// The one cell of a group.
#[track_caller]
pub(crate) fn cell(group: &str) -> Cell {
    cells(group, 1).remove(0)
}

impl Cell {
    /// A plan of 64 periods whose first cell this is.
    pub(crate) fn plan(&self) -> Plan {
        const SWEPT: [&str; 2] = ["omega", "mesh_speed"];
        let named = || GearPair::PARAMETERS.iter().map(|parameter| &*parameter.name).zip(self.0);
        let fixed: String = named()
            .filter(|(name, _)| !SWEPT.contains(name))
            .map(|(name, value)| format!("{name} = {value:?}\n"))
            .collect();
        let axes: String = SWEPT
            .iter()
            .map(|swept| named().find(|(name, _)| name == swept).unwrap())
            .map(|(name, min)| {
                format!(
                    "[[axis]]\nparameter = '{name}'\nmin = {min:?}\nmax = {:?}\ncount = 2\n",
                    2.0 * min + 1.0
                )
            })
            .collect();
        let text = format!(
            "[parameters]\n{fixed}{axes}[integration]\ntransient_periods = 32\nobserved_periods = 32\n\
             max_period = 16\n[start]\npolicy = 'state'\nstate = {:?}\n[outputs]\n\
             quantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word']\n",
            self.1
        );
        Plan::new(&Scene::parse(&text, "cell", &[], Purpose::Map).unwrap())
    }
}

/// Devices that nobody uses: to compile their shaders takes longer than to run most lanes.
static IDLE: Mutex<Vec<Gpu>> = Mutex::new(Vec::new());

fn device(precision: Precision) -> Gpu {
    let mut idle = IDLE.lock().unwrap();
    let found = idle.iter().position(|gpu| gpu.precision() == precision).map(|i| idle.swap_remove(i));
    drop(idle);
    found.unwrap_or_else(|| pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).unwrap())
}

/// What lanes say of the first cell of a plan.
pub(crate) fn lane(plan: &Plan, precision: Precision) -> Record {
    let device = device(precision);
    let mut engine = Engine::Gpu(Box::new(pollster::block_on(engine::Gpu::new(plan, device)).unwrap()));
    let cells = plan.cells(0..plan.cell_count());
    let records = pollster::block_on(engine.run(&cells)).unwrap();
    if let Engine::Gpu(gpu) = engine {
        IDLE.lock().unwrap().push(gpu.into_device());
    }
    cells.iter().zip(records).find(|(cell, _)| cell.id == 0).unwrap().1
}
