//! Every shader variant, without an adapter: it parses, it is valid, and its structs lie in
//! memory as the host's do.

use std::mem::{offset_of, size_of};
use std::sync::LazyLock;

use naga::back::{hlsl, msl, spv};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use rattlemap::gpu::{Precision, Variant, layout};

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

/// Members of a struct as `(name, offset)`, and its size.
fn shape(module: &naga::Module, name: &str) -> (Vec<(String, u32)>, u32) {
    let (_, ty) = module
        .types
        .iter()
        .find(|(_, ty)| ty.name.as_deref() == Some(name))
        .unwrap_or_else(|| panic!("the shader has no struct {name}"));
    let naga::TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no struct") };
    // A struct within a struct is read as its members.
    let flat = members.iter().flat_map(|m| match &module.types[m.ty].inner {
        naga::TypeInner::Struct { members, .. } => {
            members.iter().map(|inner| (inner.name.clone(), m.offset + inner.offset)).collect()
        }
        _ => vec![(m.name.clone(), m.offset)],
    });
    (flat.map(|(name, offset)| (name.unwrap_or_default(), offset)).collect(), *span)
}

/// Compares a struct field by field; `bytes` is the size of the shader's numbers, `host` that
/// of the host's.
macro_rules! same_layout {
    ($module:expr, $host:ty, $bytes:expr, $host_bytes:expr, [$($field:ident),* $(,)?]) => {{
        let name = stringify!($host).rsplit("::").next().unwrap().trim();
        let (members, span) = shape($module, name);
        let scaled = |bytes: usize| (bytes / $host_bytes * $bytes) as u32;
        let expected: Vec<(String, u32)> =
            vec![$((stringify!($field).to_owned(), scaled(offset_of!($host, $field)))),*];
        assert_eq!(members, expected, "{name}");
        assert_eq!(span, scaled(size_of::<$host>()), "{name}");
    }};
}

/// Everything, the class alone, and what lies between.
fn variants(precision: Precision) -> [Variant; 12] {
    let everything = Variant::of(precision);
    let class = Variant { word: false, pattern: false, mesh: false, symmetry: false, ..everything };
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
    ]
}

/// Every variant, parsed and validated once for all tests, with the size of its numbers.
static MODULES: LazyLock<Vec<(usize, naga::Module)>> = LazyLock::new(|| {
    let variants = Precision::ALL.map(|precision| variants(precision).map(|variant| (precision, variant)));
    variants.concat().into_iter().map(|(precision, variant)| (precision.bytes(), module(variant).0)).collect()
});

#[test]
fn every_variant_is_valid() {
    assert_eq!(MODULES.len(), 24);
}

#[test]
fn constants_lie_as_the_host_says() {
    for (real, module) in &*MODULES {
        same_layout!(
            module,
            layout::Domain,
            *real,
            8,
            [step, gap_row, x_row, energy, growth, angle, turn_half, turn_sin, share, substeps]
        );
        same_layout!(
            module,
            layout::Flow,
            *real,
            8,
            [domains, walls, kick, h, speed, closing, steady, reach, decay, pressing, damper]
        );
        same_layout!(module, layout::Law, *real, 8, [restitution, mesh_speed]);
        same_layout!(module, layout::FlowShape, 4, 4, [steps, phasors, degrees, contacts]);
        same_layout!(module, layout::Cell, 4, 4, [flow_index, law_index, refused, mirror]);
    }
}

#[test]
fn settings_lie_as_the_host_says() {
    for (_, module) in &*MODULES {
        same_layout!(
            module,
            layout::Settings,
            4,
            4,
            [
                slots,
                active_lanes,
                fresh,
                periods,
                longest,
                chaos_from,
                chaos_errors,
                iterations,
                passes_per_period,
                events_per_period,
                most_events,
                row,
                transient_periods,
                growth_from,
                exponent_from,
                exponent_block,
                max_period,
                early_stop,
                ended
            ]
        );
    }
}

#[test]
fn what_a_lane_carries_lies_as_the_host_says() {
    for (real, module) in &*MODULES {
        same_layout!(
            module,
            layout::Motion,
            *real,
            8,
            [
                q,
                phasor,
                theta,
                bound,
                bend,
                mesh_part,
                block_growth,
                growth_sum,
                growth_squares,
                anchor,
                position_scale,
                rate_scale,
                cycle_growth,
                tangents,
                vector,
                trail
            ]
        );
        same_layout!(
            module,
            layout::Tally,
            4,
            4,
            [
                step,
                cut,
                mode,
                origin,
                order,
                period,
                status,
                passes_in_period,
                events_in_period,
                impacts,
                events,
                mesh_right,
                mesh_left,
                mesh_whole,
                grazes,
                stage,
                candidate,
                to_read,
                tangent_count,
                grows,
                word_length,
                hash_low,
                hash_high,
                recent,
                on_strobe,
                itinerary,
                has_read,
                cycle,
                tries,
                counted_from,
                blocks,
                block_periods,
                anchor_period,
                window,
                streak,
                known_lags,
                settled,
                mirror,
                apart,
                apart_before,
                refinements,
                branch,
                branch_period,
                home_mode,
                home_origin,
                divisor,
                divisor_apart,
                failed_searches,
                asked,
                rejected_divisor,
                off,
                passed,
                shown,
                all_events,
                distances,
                last_distances,
                itineraries,
                word,
                pattern,
                pattern_length,
                pattern_hash,
                pattern_recent
            ]
        );
    }
}

#[test]
fn what_a_lane_hands_back_lies_as_the_host_says() {
    for (real, module) in &*MODULES {
        same_layout!(module, layout::Reading, *real, 8, [strobe, growth, growth_error, mesh_fraction]);
        same_layout!(
            module,
            layout::Finding,
            4,
            4,
            [
                valid,
                slot,
                status,
                period,
                periods_run,
                impacts,
                counted,
                symmetric,
                word_length,
                hash_low,
                hash_high,
                word,
                pattern_length,
                pattern_hash,
                pattern
            ]
        );
    }
}

/// What Vulkan, Metal and DirectX 12 get: wgpu translates the shaders when a device compiles
/// them. Metal has no double precision at all, and wgpu asks DirectX for none.
#[test]
fn every_variant_translates_for_every_kind_of_device() {
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
