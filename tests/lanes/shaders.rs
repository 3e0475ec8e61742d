//! Shader variants, without an adapter: they are valid, and their structs have the host's layout.

use std::sync::LazyLock;

use naga::back::{hlsl, msl, spv};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use rattlemap::gpu::{Features, MachineShape, Measures, Precision, Variant, layout};

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

/// Returns the members of a struct as `(name, offset)`, and its size.
fn shape(module: &naga::Module, name: &str) -> (Vec<(String, u32)>, u32) {
    let (_, ty) = module
        .types
        .iter()
        .find(|(_, ty)| ty.name.as_deref() == Some(name))
        .unwrap_or_else(|| panic!("the shader has no struct {name}"));
    let naga::TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no struct") };
    // Members of an inner struct count as members of the outer one; a copy of an inner struct counts as one member.
    let flat = members.iter().flat_map(|m| match &module.types[m.ty].inner {
        naga::TypeInner::Struct { members, .. } if m.name.as_deref() != Some("ended") => {
            members.iter().map(|inner| (inner.name.clone(), m.offset + inner.offset)).collect()
        }
        _ => vec![(m.name.clone(), m.offset)],
    });
    (flat.map(|(name, offset)| (name.unwrap_or_default(), offset)).collect(), *span)
}

/// Returns variants with all quantities, with the class alone, and with some quantities.
fn variants(precision: Precision) -> [Variant; 23] {
    let everything = Variant::of(precision);
    let measuring = |extremes, moments| Variant {
        measures: Some(Measures { periods: 1, extremes, moments }),
        exponent: false,
        growth: false,
        chatter: false,
        ..everything
    };
    let class = Variant { word: false, pattern: false, mesh: false, symmetry: false, ..everything };
    let all = Features { stages: true, ..class.features };
    [
        Variant { keep: true, ..everything },
        Variant { growth: false, ..everything },
        Variant { exponent: false, growth: false, ..everything },
        Variant { workgroup: 256, keep: true, ..class },
        Variant { growth: false, ..class },
        Variant { chatter: false, keep: true, ..everything },
        Variant { chatter: false, growth: false, ..class },
        Variant { workgroup: 32, exponent: false, growth: false, ..class },
        Variant { symmetry: true, ..class },
        Variant { mesh: true, keep: true, ..class },
        Variant { word: true, growth: false, ..class },
        Variant { pattern: true, ..class },
        Variant { keep: true, ..measuring(true, true) },
        measuring(false, true),
        measuring(true, false),
        Variant { features: Features { harmonics: 7, ..class.features }, keep: true, ..class },
        Variant { features: Features { harmonics: 1, stages: true, ..class.features }, ..everything },
        Variant {
            features: Features { harmonics: 2, intervals: true, pushing: true, ..all },
            ..measuring(true, true)
        },
        Variant { features: Features { intervals: true, pushing: true, ..class.features }, ..everything },
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
            growth: false,
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
    assert_eq!(MODULES.len(), 46);
}

/// Offsets on the host are scaled by the size of the shader's numbers.
#[test]
fn structs_have_the_same_layout_on_host_and_device() {
    assert_eq!(layout::STRUCTS.len(), 11);
    for (variant, module) in &*MODULES {
        let is_of_oscillator = |name: &str| ["Domain", "Flow", "FlowShape", "Law"].contains(&name);
        let dim = variant.features.machine.map_or(4, |machine| 2 * machine.coordinates as usize);
        for host in layout::STRUCTS {
            if variant.features.machine.is_some() && is_of_oscillator(host.name) {
                continue;
            }
            let (bytes, host_bytes) = if host.is_real { (variant.precision.bytes(), 8) } else { (4, 4) };
            let scaled = |offset: usize| (offset / host_bytes * bytes) as u32;
            let (mut members, span) = shape(module, host.name);
            let expected = host.fields.iter().map(|&(name, offset)| (name.to_owned(), scaled(offset)));
            if host.name == "Measured" {
                assert_eq!(members.pop().map(|(name, _)| name).as_deref(), Some("tangents"));
            }
            if dim == 4 || host.name != "Motion" {
                assert_eq!(members, expected.collect::<Vec<_>>(), "{}", host.name);
            }
            let size = match host.name {
                "Finding" => 4 * layout::Finding::length(variant.word || variant.pattern),
                _ => layout::size_with(host, dim),
            };
            assert_eq!(span, scaled(size), "{}", host.name);
        }
    }
}

/// wgpu translates shaders for Vulkan, Metal and DirectX 12 when a device compiles them. Metal has no double
/// precision, and wgpu does not use that of DirectX.
#[test]
fn variants_translate_for_every_kind_of_device() {
    for exponent in [false, true] {
        for precision in Precision::ALL {
            let variant = Variant { exponent, growth: exponent, ..Variant::of(precision) };
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
