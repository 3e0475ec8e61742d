//! Tests that need no device: texts, scenes, models, and the order of the layers.

mod docs;
mod layers;
mod model_files;
mod scene_fuzz;
