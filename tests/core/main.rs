//! What needs no device: texts, the order of the layers, scenes.

mod docs;
mod layers;
mod scene_fuzz;
