//! What needs no device: texts, the order of the layers, scenes.

mod docs;
mod layers;
mod model_files;
mod scene_fuzz;
