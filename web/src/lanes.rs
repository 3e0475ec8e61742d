//! Lanes on the graphics device of the browser, in f32.

use rattlemap::gpu::{self, AdapterChoice, Gpu, Precision};
use rattlemap::map::engine::{self, Engine, Prepared};
use rattlemap::map::plan::Cell;
use wasm_bindgen::prelude::wasm_bindgen;

use crate::Window;

/// A graphics device, and the window that it computes. A window computes the same records on it as the program does in f32 on
/// the same device.
#[wasm_bindgen]
pub struct Lanes {
    engine: Option<Engine<'static>>,
    device: Option<Gpu>,
    is_hardware: bool,
}

#[wasm_bindgen]
impl Lanes {
    /// Opens the first adapter of the browser.
    ///
    /// # Errors
    /// If the browser has no adapter, or the adapter's limits are too low.
    pub async fn open() -> Result<Lanes, String> {
        let opened = Gpu::open(Precision::F32, &AdapterChoice::default()).await;
        let device = opened.map_err(|error| error.to_string())?;
        let is_hardware = gpu::is_hardware(device.adapter());
        Ok(Lanes { engine: None, device: Some(device), is_hardware })
    }

    /// Whether the device is hardware, not a program on the processor.
    pub fn is_hardware(&self) -> bool {
        self.is_hardware
    }

    /// Prepares the device for a window. The first window with certain quantities compiles shaders, and computes known answers
    /// with them.
    ///
    /// # Errors
    /// If the driver refuses a shader, a known answer is wrong, or the flows of the window need too much memory. The device
    /// cannot be used afterwards.
    pub async fn prepare(&mut self, window: &Window) -> Result<(), String> {
        let previous = match self.engine.take() {
            Some(Engine::Gpu(engine)) => Some(engine.into_device()),
            _ => self.device.take(),
        };
        let device = previous.ok_or("the device failed before")?;
        let prepared = Prepared::new(&window.plan).into_owned();
        let engine = engine::Gpu::prepared(prepared, device).await.map_err(|error| error.to_string())?;
        self.engine = Some(Engine::Gpu(Box::new(engine)));
        Ok(())
    }

    /// Computes runs of the prepared window. Returns the bytes of their records, in the same order.
    ///
    /// # Errors
    /// If the device fails, or no window was prepared.
    pub async fn compute(&mut self, window: &Window, runs: Vec<u32>) -> Result<Vec<u8>, String> {
        let engine = self.engine.as_mut().ok_or("no window was prepared")?;
        let cells: Vec<Cell> = runs.iter().map(|&run| window.plan.cell(run)).collect();
        let records = engine.run(&cells).await.map_err(|error| error.to_string())?;
        Ok(records.iter().flat_map(|record| record.to_bytes()).collect())
    }
}
