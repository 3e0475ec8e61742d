//! Shader variants, without an adapter: they are valid, and their structs have the host's sizes.

use std::sync::LazyLock;

use naga::back::{hlsl, msl, spv};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use rattlemap::gpu::{Features, MachineShape, Measures, Precision, Tangents, Variant, layout};

fn module(variant: Variant) -> (naga::Module, ModuleInfo) {
    let source = variant.source();
    let module = naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{variant:?}: {}", error.emit_to_string(&source)));
    let capabilities = match variant.precision {
        Precision::F32 => Capabilities::empty(),
        Precision::F64 => Capabilities::FLOAT64,
    };
    let info = Validator::new(ValidationFlags::all(), capabilities)
        .validate(&module)
        .unwrap_or_else(|error| panic!("{variant:?}: {}", error.emit_to_string(&source)));
    (module, info)
}

/// Returns the size of a struct in bytes.
fn span(module: &naga::Module, name: &str) -> usize {
    let found = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name));
    let (_, ty) = found.unwrap_or_else(|| panic!("the shader has no struct {name}"));
    let naga::TypeInner::Struct { span, .. } = ty.inner else { panic!("{name} is no struct") };
    span as usize
}

/// Returns variants with all quantities, with the class alone, and with some quantities.
fn variants(precision: Precision) -> [Variant; 22] {
    let everything = Variant::of(precision);
    let measuring = |extremes, moments| Variant {
        measures: Some(Measures { periods: 1, extremes, moments }),
        exponent: false,
        tangents: Tangents::None,
        chatter: false,
        ..everything
    };
    let class = Variant { word: false, pattern: false, mesh: false, symmetry: false, ..everything };
    let all = Features { stages: true, ..class.features };
    [
        everything,
        Variant { tangents: Tangents::None, ..everything },
        Variant { exponent: false, tangents: Tangents::None, ..everything },
        Variant { workgroup: 256, ..class },
        Variant { tangents: Tangents::Columns, ..class },
        Variant { chatter: false, ..everything },
        Variant { chatter: false, tangents: Tangents::None, ..class },
        Variant { workgroup: 32, exponent: false, tangents: Tangents::None, ..class },
        Variant { symmetry: true, ..class },
        Variant { mesh: true, ..class },
        Variant { word: true, tangents: Tangents::None, ..class },
        Variant { pattern: true, ..class },
        measuring(true, true),
        measuring(false, true),
        measuring(true, false),
        Variant { features: Features { harmonics: 7, ..class.features }, ..class },
        Variant { features: Features { harmonics: 1, stages: true, ..class.features }, ..everything },
        Variant { features: Features { harmonics: 2, ..all }, ..measuring(true, true) },
        Variant {
            features: Features { machine: Some(machine(2, 1, 0, 1)), ..Features::default() },
            ..everything
        },
        Variant { features: Features { machine: Some(machine(3, 2, 1, 2)), ..Features::default() }, ..class },
        Variant {
            features: Features { machine: Some(machine(8, 3, 2, 8)), ..Features::default() },
            ..everything
        },
        Variant {
            features: Features { machine: Some(machine(4, 3, 2, 0)), ..Features::default() },
            exponent: false,
            tangents: Tangents::None,
            ..class
        },
    ]
}

/// Sizes of a machine with so many coordinates, gaps, elements with friction and harmonics.
fn machine(coordinates: u32, gaps: u32, elements: u32, harmonics: u32) -> MachineShape {
    MachineShape { coordinates, gaps, elements, harmonics, walls: 2, stages: 2 }
}

/// All variants, parsed and validated once for all tests.
static MODULES: LazyLock<Vec<(Variant, naga::Module)>> = LazyLock::new(|| {
    let variants = Precision::ALL.map(variants).concat();
    variants.into_iter().map(|variant| (variant, module(variant).0)).collect()
});

#[test]
fn every_variant_is_valid() {
    assert_eq!(MODULES.len(), 44);
}

/// Structs have the same fields on both sides, because one declaration serves both. Their sizes on the host are scaled by the size of the
/// shader's numbers.
#[test]
fn structs_have_the_same_size_on_host_and_device() {
    for (variant, module) in &*MODULES {
        let real = variant.precision.bytes();
        let check = |name, expected: usize| assert_eq!(span(module, name), expected, "{name}");
        let dim = variant.features.machine.map_or(4, |machine| 2 * machine.coordinates as usize);
        for (name, bytes) in [
            ("Cell", 4),
            ("Settings", 4),
            ("Motion", real),
            ("Tally", 4),
            ("Reading", real),
            ("Measured", real),
        ] {
            check(name, layout::length_of(name, dim) * bytes);
        }
        check("Finding", 4 * layout::Finding::length(variant.word || variant.pattern));
        check("Settings", size_of::<layout::Settings>());
        check("Cell", size_of::<layout::Cell>());
        if variant.features.machine.is_none() {
            check("Domain", size_of::<layout::Domain>() / 8 * real);
            check("Flow", size_of::<layout::Flow>() / 8 * real);
            check("FlowShape", size_of::<layout::FlowShape>());
            check("Law", size_of::<layout::Law>() / 8 * real);
        }
    }
}

/// wgpu translates shaders for Vulkan, Metal and DirectX 12 when a device compiles them. Metal has no double
/// precision, and wgpu does not use that of DirectX.
#[test]
fn variants_translate_for_every_kind_of_device() {
    for exponent in [false, true] {
        for precision in Precision::ALL {
            let variant = Variant {
                exponent,
                tangents: if exponent { Tangents::Columns } else { Tangents::None },
                ..Variant::of(precision)
            };
            let (module, info) = module(variant);
            let words = spv::write_vec(&module, &info, &spv::Options::default(), None)
                .unwrap_or_else(|error| panic!("SPIR-V, {variant:?}: {error}"));
            assert!(words.len() > 10_000, "{variant:?}: {} words", words.len());
            if precision == Precision::F64 {
                continue;
            }
            let options = msl::Options { fake_missing_bindings: true, ..msl::Options::default() };
            let (text, _) = msl::write_string(&module, &info, &options, &msl::PipelineOptions::default())
                .unwrap_or_else(|error| panic!("Metal, {variant:?}: {error}"));
            assert!(text.contains("kernel void sweep"), "{variant:?}");
            let (options, mut text) = (hlsl::Options::default(), String::new());
            let pipeline = hlsl::PipelineOptions::default();
            hlsl::Writer::new(&mut text, &options, &pipeline)
                .write(&module, &info, None)
                .unwrap_or_else(|error| panic!("HLSL, {variant:?}: {error}"));
            assert!(text.contains("void sweep("), "{variant:?}");
        }
    }
}
