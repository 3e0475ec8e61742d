//! The built-in models: the files in `models/`.

use std::sync::LazyLock;

use rattlemap_dynamics::model::Model;

use super::FileModel;

/// Name of the copy of the model's file in the folder of a map whose model is not built in.
pub const MODEL_FILE: &str = "model.toml";

/// The default model of scenes and commands.
pub const DEFAULT: &str = "gear-pair";

/// Names and texts of the built-in models.
pub const BUILT_IN: &[(&str, &str)] = &[
    (DEFAULT, include_str!("../../models/gear_pair.toml")),
    ("impact-oscillator", include_str!("../../models/impact_oscillator.toml")),
    ("bilinear", include_str!("../../models/bilinear.toml")),
    ("kahraman-singh", include_str!("../../models/kahraman_singh.toml")),
    ("soft-impact", include_str!("../../models/soft_impact.toml")),
    ("two-masses", include_str!("../../models/two_masses.toml")),
    ("coco-impact", include_str!("../../models/coco_impact.toml")),
    ("shaking-table", include_str!("../../models/shaking_table.toml")),
    ("shaken-container", include_str!("../../models/shaken_container.toml")),
    ("impact-damper", include_str!("../../models/impact_damper.toml")),
    ("energy-sink", include_str!("../../models/energy_sink.toml")),
    ("loose-gear", include_str!("../../models/loose_gear.toml")),
    ("mesh-stiffness", include_str!("../../models/mesh_stiffness.toml")),
    ("meissner", include_str!("../../models/meissner.toml")),
    ("mathieu", include_str!("../../models/mathieu.toml")),
    ("clutch", include_str!("../../models/clutch.toml")),
    ("backlash", include_str!("../../models/backlash.toml")),
    ("friction-oscillator", include_str!("../../models/friction_oscillator.toml")),
    ("drag-gear", include_str!("../../models/drag_gear.toml")),
    ("relief-valve", include_str!("../../models/relief_valve.toml")),
    ("turbine-gears", include_str!("../../models/turbine_gears.toml")),
    ("two-loose-gears", include_str!("../../models/two_loose_gears.toml")),
    ("absorber-chain", include_str!("../../models/absorber_chain.toml")),
    ("viscoelastic-ball", include_str!("../../models/viscoelastic_ball.toml")),
    ("duffing", include_str!("../../models/duffing.toml")),
    ("hertz-ball", include_str!("../../models/hertz_ball.toml")),
    ("belt-oscillator", include_str!("../../models/belt_oscillator.toml")),
];

/// The built-in models, read once. A test shows that each can be read.
static READ: LazyLock<Vec<FileModel>> = LazyLock::new(|| {
    BUILT_IN.iter().filter_map(|(name, text)| FileModel::parse(text, &format!("{name}.toml")).ok()).collect()
});

pub(super) fn find(name: &str) -> Option<&'static FileModel> {
    READ.iter().find(|model| model.name() == name)
}
