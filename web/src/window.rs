//! A part of a map that workers of the page compute.

use rattlemap::map::engine::Cpu;
use rattlemap::map::plan::{Cell, Plan};
use rattlemap::map::scene::{FileText, Purpose, Scene};
use rattlemap::record::Record;
use rattlemap::record::classify::classify;
use rattlemap::show::cells::{Cells, Survey};
use rattlemap::show::drawing::svg;
use rattlemap::show::layers::Layer;
use rattlemap::show::provenance::Provenance;
use rattlemap::show::words::MapWords;
use rattlemap::show::{figure, layers, report, words};
use rattlemap_dynamics::orbit::Class;
use wasm_bindgen::prelude::wasm_bindgen;

/// The runs of a scene, which may be computed in parts by several workers.
#[wasm_bindgen]
pub struct Window {
    scene: Scene,
    pub(crate) plan: Plan,
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
                "each cell of this map starts from the final state of its neighbour, so no part can be computed alone".into()
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
        Cpu::new(&self.plan).compute(&cells).iter().flat_map(Record::to_bytes).collect()
    }

    /// Returns two bytes per run: the index of its class, and its period, which is 0 if there is none.
    ///
    /// # Panics
    /// If there is no such run.
    pub fn labels(&self, runs: &[u32]) -> Vec<u8> {
        let cells: Vec<Cell> = runs.iter().map(|&run| self.plan.cell(run)).collect();
        let classes = Cpu::new(&self.plan).compute(&cells).into_iter().map(|record| classify(&record));
        let label = |class: Class| match class {
            Class::Periodic { period } => [class.index() as u8, period as u8],
            _ => [class.index() as u8, 0],
        };
        classes.flat_map(label).collect()
    }

    /// Returns the data of a page that shows these records, as JSON. `records` has the bytes of one record per run.
    ///
    /// # Errors
    /// If `records` does not have one record per run.
    pub fn data(&self, records: &[u8]) -> Result<String, String> {
        self.shown(records, |cells, layers, words| {
            let made = Provenance {
                engine: "cpu",
                precision: "f64",
                device: "browser",
                commit: "of the program that wrote it",
            };
            report::data(cells, &made, layers, words, None).to_string()
        })
    }

    /// Draws a layer of these records as an SVG figure.
    ///
    /// # Errors
    /// As for [`Window::data`], or if no layer has this name.
    pub fn figure(&self, records: &[u8], layer: &str) -> Result<String, String> {
        self.shown(records, |cells, layers, _| {
            let layer = layers.iter().find(|each| each.name() == layer).ok_or("no such layer")?;
            Ok(svg(&figure::map::draw(cells, layers, layer)))
        })?
    }

    /// Builds cells, layers and words from records, and passes them to a function.
    fn shown<T>(
        &self,
        records: &[u8],
        use_them: impl FnOnce(&Cells<'_>, &[Layer], &MapWords) -> T,
    ) -> Result<T, String> {
        if records.len() != self.runs() * Record::BYTES {
            return Err(format!("{} bytes are not the records of {} runs", records.len(), self.runs()));
        }
        let records: Vec<Record> = records.chunks(Record::BYTES).map(Record::from_bytes).collect();
        let survey = Survey::of(&self.plan, &records, None);
        let cells = Cells::new(&self.scene, &self.plan, &records).surveyed(&survey);
        let words = words::read(&cells);
        Ok(use_them(&cells, &layers::of(&cells, &words), &words))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "model = 'two-masses'\n[[axis]]\nparameter = 'omega'\nmin = 1.0\nmax = 1.4\ncount = 5\n\
                         [[axis]]\nparameter = 'e'\nmin = 0.6\nmax = 0.9\ncount = 4\n[outputs]\nquantities = ['class', 'word']\n";

    #[test]
    fn parts_of_a_window_give_the_data_of_the_whole() {
        let window = Window::new(SCENE, "", "").unwrap();
        let all: Vec<u32> = (0..window.runs() as u32).collect();
        let whole = window.compute(&all);
        let parts: Vec<u8> = all.chunks(7).flat_map(|runs| window.compute(runs)).collect();
        assert_eq!(whole, parts);
        let data: serde_json::Value = serde_json::from_str(&window.data(&whole).unwrap()).unwrap();
        assert_eq!((&data["axes"][0]["count"], &data["layers"][0]["name"]), (&5.into(), &"map".into()));
        assert!(window.figure(&whole, "map").unwrap().starts_with("<svg "));
        assert_eq!(window.figure(&whole, "impacts"), Err("no such layer".to_owned()));
        assert_eq!(window.labels(&all).len(), 2 * all.len());
        assert!(window.data(&whole[1..]).is_err());
    }

    #[test]
    fn parameters_are_set_and_wrong_ones_are_errors() {
        let set = |sets: &str| Window::new(SCENE, "", sets).map(|window| window.scene.settings().to_owned());
        assert!(set("parameters.mu=0.7").is_ok_and(|settings| settings.contains("mu = 0.7")));
        let text = SCENE.replace("two-masses", "own.toml");
        assert!(set("parameters.nothing=0.3").is_err_and(|error| error.contains("nothing")));
        assert!(Window::new(&text, "", "").is_err_and(|error| error.contains("not in this page")));
        let followed = format!("{SCENE}[start]\npolicy = 'up'\n");
        assert!(Window::new(&followed, "", "").is_err_and(|error| error.contains("final state")));
    }
}
