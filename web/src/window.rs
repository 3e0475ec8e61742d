//! A part of a map that workers of the page compute.

use rattlemap::map::engine::Cpu;
use rattlemap::map::plan::{Cell, Plan};
use rattlemap::map::scene::{FileText, Format, Purpose, Scene};
use rattlemap::record::Record;
use rattlemap::show::cells::{Cells, Survey};
use rattlemap::show::layers::Layer;
use rattlemap::show::provenance::Provenance;
use rattlemap::show::words::MapWords;
use rattlemap::show::{figure, layers, report, words};
use wasm_bindgen::prelude::wasm_bindgen;

/// The runs of a scene, which may be computed in parts by several workers.
#[wasm_bindgen]
pub struct Window {
    scene: Scene,
    plan: Plan,
}

#[wasm_bindgen]
impl Window {
    /// Reads a scene. `model` is the text of its model file; it is empty for a built-in model. `sets` has one `NAME=VALUE` per
    /// line, which override the scene.
    ///
    /// # Errors
    /// The scene's first error, or a cell without motion.
    #[wasm_bindgen(constructor)]
    pub fn new(scene: &str, model: &str, sets: &str) -> Result<Window, String> {
        let sets: Vec<String> = sets.lines().map(str::to_owned).collect();
        let find = |_, name: &str| match model {
            "" => Err("is not in this page".to_owned()),
            text => Ok(FileText { name: name.to_owned(), text: text.to_owned() }),
        };
        let scene = Scene::parse_with_files(scene, "view", &sets, Purpose::Map, None, &find)
            .map_err(|error| error.to_string())?;
        if scene.start().follows() {
            return Err(
                "cells of this map start where their neighbours end, so a part of it is another map".into()
            );
        }
        let plan = Plan::new(&scene);
        plan.check().map_err(|error| error.to_string())?;
        Ok(Window { scene, plan })
    }

    /// Number of runs: one per cell and start.
    pub fn runs(&self) -> usize {
        self.plan.run_count()
    }

    /// Computes runs. Returns the bytes of their records, in the same order.
    ///
    /// # Panics
    /// If there is no such run.
    pub fn compute(&self, runs: &[u32]) -> Vec<u8> {
        let cells: Vec<Cell> = runs.iter().map(|&run| self.plan.cell(run)).collect();
        bytemuck::pod_collect_to_vec(&Cpu::new(&self.plan).compute(&cells))
    }

    /// Returns the data of a page that shows these records, as JSON. `records` has the bytes of one record per run.
    ///
    /// # Errors
    /// A number of bytes that is not that of all records.
    pub fn data(&self, records: &[u8]) -> Result<String, String> {
        self.shown(records, |cells, layers, words| {
            let made = Provenance {
                engine: "cpu",
                precision: "f64",
                device: "this page",
                commit: "of the program that wrote it",
            };
            report::data(cells, &made, layers, words, None).to_string()
        })
    }

    /// Draws a layer of these records as an SVG figure.
    ///
    /// # Errors
    /// As for [`Window::data`]; a name that is not that of a layer.
    pub fn figure(&self, records: &[u8], layer: &str) -> Result<String, String> {
        self.shown(records, |cells, layers, _| {
            let layer = layers.iter().find(|each| each.name() == layer).ok_or("no such layer")?;
            let mut svg = Vec::new();
            figure::map::write(&mut svg, Format::Svg, cells, layer).map_err(|error| error.to_string())?;
            String::from_utf8(svg).map_err(|error| error.to_string())
        })?
    }

    /// Calls a function with the cells that have these records, their layers and words.
    fn shown<T>(
        &self,
        records: &[u8],
        use_them: impl FnOnce(&Cells<'_>, &[Layer], &MapWords) -> T,
    ) -> Result<T, String> {
        if records.len() != self.runs() * size_of::<Record>() {
            return Err(format!("{} bytes are not the records of {} runs", records.len(), self.runs()));
        }
        let records: Vec<Record> = bytemuck::pod_collect_to_vec(records);
        let survey = Survey::of(&self.plan, &records, None);
        let cells = Cells::new(&self.scene, &self.plan, &records).surveyed(&survey);
        let words = words::read(&cells);
        Ok(use_them(&cells, &layers::of(&cells, &words), &words))
    }
}
