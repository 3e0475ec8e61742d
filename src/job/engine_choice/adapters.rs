//! Which adapters a map takes, by what was asked for and what there is.

use std::convert::Infallible;
use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use crate::gpu::{self, AdapterChoice, AdapterReport, GpuError, Precision};

/// The adapter that somebody asks for, in the place of the one that the environment names or of the best.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// By its number, [`AdapterReport::number`].
    Number(usize),
    /// By a part of its name, driver or PCI address that no other has, in any case of letters.
    Named(String),
    /// All that are equal to the one that would be taken if none were asked for.
    All,
}

impl FromStr for Wanted {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Wanted, Infallible> {
        Ok(match (text, text.parse()) {
            ("all", _) => Wanted::All,
            (_, Ok(number)) => Wanted::Number(number),
            (name, Err(_)) => Wanted::Named(name.to_owned()),
        })
    }
}

impl fmt::Display for Wanted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Wanted::Number(number) => write!(f, "{number}"),
            Wanted::Named(name) => f.write_str(name),
            Wanted::All => f.write_str("all"),
        }
    }
}

/// Adapters to open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Taken {
    /// By number, one at least.
    pub(crate) numbers: Vec<usize>,
    /// Why others are left out, where all are asked for.
    pub(crate) left_out: Vec<String>,
}

/// Why no adapter is taken.
#[derive(Debug, Error)]
pub enum AdapterError {
    /// No adapter has this number.
    #[error("--adapter {number}: no adapter has this number; there are: {list}")]
    NoSuchNumber {
        /// The number.
        number: usize,
        /// Numbers and names of those that there are.
        list: String,
    },
    /// No adapter is called so.
    #[error("--adapter {name}: no adapter's name, driver or PCI address has this part; there are: {list}")]
    NoneCalled {
        /// The part.
        name: String,
        /// Numbers and names of those that there are.
        list: String,
    },
    /// Several adapters are called so.
    #[error("--adapter {name}: more than one adapter has this part in its name; give a number: {list}")]
    Ambiguous {
        /// The part.
        name: String,
        /// Numbers and names of those that have it.
        list: String,
    },
    /// The adapter that was asked for lacks the precision.
    #[error("adapter {adapter} has no {precision}; choose {remedies}")]
    Lacks {
        /// Its number and name.
        adapter: String,
        /// What it lacks.
        precision: &'static str,
        /// What else may be asked for.
        remedies: String,
    },
    /// Hardware is there, and none of it has the precision. A software driver is no stand-in that is taken in silence: it
    /// may be slower by orders of magnitude.
    #[error("no graphics card here has {precision}: {cards}; choose {remedies}")]
    NoCardHas {
        /// What they lack.
        precision: &'static str,
        /// Numbers and names of the cards.
        cards: String,
        /// What else may be asked for.
        remedies: String,
    },
    /// There is none.
    #[error(transparent)]
    None(GpuError),
}

/// The adapters that somebody `wanted`; the best that the `environment` allows if nobody did.
///
/// # Errors
/// [`AdapterError`].
pub(crate) fn take(
    all: &[AdapterReport],
    wanted: Option<&Wanted>,
    environment: &AdapterChoice,
    precision: Precision,
) -> Result<Taken, AdapterError> {
    let only = |number| Taken { numbers: vec![number], left_out: Vec::new() };
    match wanted {
        None => best(all, environment, precision).map(|best| only(best.number)),
        Some(Wanted::All) => best(all, environment, precision).map(|best| equal_to(best, all)),
        Some(Wanted::Number(number)) => {
            with(precision, numbered(*number, all)?, all).map(|found| only(found.number))
        }
        Some(Wanted::Named(name)) => with(precision, called(name, all)?, all).map(|found| only(found.number)),
    }
}

impl Wanted {
    /// Those of a machine's adapters that are asked for, whatever they can do.
    ///
    /// # Errors
    /// [`AdapterError`] if there is no such adapter, or a name that one alone should have is that of several.
    pub fn among<'a>(&self, all: &'a [AdapterReport]) -> Result<&'a [AdapterReport], AdapterError> {
        match self {
            Wanted::Number(number) => numbered(*number, all).map(std::slice::from_ref),
            Wanted::Named(name) => called(name, all).map(std::slice::from_ref),
            Wanted::All => Ok(all),
        }
    }
}

fn numbered(number: usize, all: &[AdapterReport]) -> Result<&AdapterReport, AdapterError> {
    let found = all.iter().find(|adapter| adapter.number == number);
    found.ok_or_else(|| AdapterError::NoSuchNumber { number, list: listed(all) })
}

/// The first that is allowed and has the precision, but no software driver beside hardware.
fn best<'a>(
    all: &'a [AdapterReport],
    environment: &AdapterChoice,
    precision: Precision,
) -> Result<&'a AdapterReport, AdapterError> {
    let allowed = || all.iter().filter(|adapter| environment.allows(adapter));
    let cards = || allowed().filter(|adapter| is_hardware(adapter));
    let fits = |adapter: &&AdapterReport| adapter.precisions.contains(&precision);
    match allowed().find(fits) {
        Some(found) if is_hardware(found) || cards().next().is_none() => Ok(found),
        None if cards().next().is_none() => {
            Err(AdapterError::None(gpu::no_adapter(precision, environment, all)))
        }
        _ => Err(AdapterError::NoCardHas {
            precision: precision.name(),
            cards: listed(cards()),
            remedies: remedies(precision, all),
        }),
    }
}

/// The one whose name has this part. A card that several interfaces lead to is taken by the best of them.
fn called<'a>(name: &str, all: &'a [AdapterReport]) -> Result<&'a AdapterReport, AdapterError> {
    let part = name.to_lowercase();
    let has = |adapter: &&AdapterReport| {
        let names = [gpu::describe(&adapter.info), adapter.info.device_pci_bus_id.clone()];
        names.iter().any(|name| name.to_lowercase().contains(&part))
    };
    let found: Vec<&AdapterReport> = all.iter().filter(has).collect();
    match found[..] {
        [] => Err(AdapterError::NoneCalled { name: name.to_owned(), list: listed(all) }),
        [first, ref others @ ..] if others.iter().all(|other| is_same_card(first, other)) => Ok(first),
        _ => Err(AdapterError::Ambiguous { name: name.to_owned(), list: listed(found) }),
    }
}

/// An adapter that was asked for, if it has the precision.
fn with<'a>(
    precision: Precision,
    found: &'a AdapterReport,
    all: &[AdapterReport],
) -> Result<&'a AdapterReport, AdapterError> {
    if found.precisions.contains(&precision) {
        return Ok(found);
    }
    Err(AdapterError::Lacks {
        adapter: found.id().to_string(),
        precision: precision.name(),
        remedies: remedies(precision, all),
    })
}

/// All adapters of one model, by one interface and driver: their records are the same to the bit.
fn equal_to(first: &AdapterReport, all: &[AdapterReport]) -> Taken {
    let model =
        |adapter: &AdapterReport| (adapter.info.vendor, adapter.info.device, gpu::describe(&adapter.info));
    let mut taken = vec![first];
    let mut left_out = Vec::new();
    for adapter in all {
        if taken.iter().any(|taken| taken.number == adapter.number || is_same_card(taken, adapter)) {
            continue;
        }
        if model(adapter) == model(first) {
            taken.push(adapter);
            continue;
        }
        let why = match (is_hardware(first), is_hardware(adapter)) {
            (true, false) => "it is a software driver",
            _ if adapter.info.name == first.info.name => "it has another interface or driver",
            _ => "it is of another model",
        };
        left_out.push(format!("adapter {} is left out: {why}", adapter.id()));
    }
    Taken { numbers: taken.iter().map(|adapter| adapter.number).collect(), left_out }
}

/// Whether two adapters are one card: by two interfaces (some of which do not tell the model), or listed twice.
fn is_same_card(one: &AdapterReport, other: &AdapterReport) -> bool {
    let (one, other) = (&one.info, &other.info);
    if one.backend != other.backend {
        return one.vendor == other.vendor
            && (one.device == other.device || one.device.min(other.device) == 0);
    }
    // By other interfaces equal cards have one address, too.
    let has_address = one.backend == wgpu::Backend::Vulkan && !one.device_pci_bus_id.is_empty();
    has_address && one.device_pci_bus_id == other.device_pci_bus_id
}

fn is_hardware(adapter: &AdapterReport) -> bool {
    gpu::is_hardware(&adapter.info)
}

/// What to ask for instead of a precision that is lacking.
fn remedies(precision: Precision, all: &[AdapterReport]) -> String {
    let mut list = match precision {
        Precision::F64 => {
            vec!["--engine cpu, which computes in f64".to_owned(), "--precision f32".to_owned()]
        }
        Precision::F32 => vec!["--engine cpu".to_owned()],
    };
    let others = all.iter().filter(|adapter| adapter.precisions.contains(&precision));
    list.extend(others.map(|adapter| {
        let kind = if is_hardware(adapter) { "" } else { ", a software driver" };
        format!("--adapter {} ({}{kind})", adapter.number, adapter.info.name)
    }));
    let last = list.pop().unwrap_or_default();
    if list.is_empty() { last } else { format!("{} or {last}", list.join(", ")) }
}

/// Numbers and names.
fn listed<'a>(adapters: impl IntoIterator<Item = &'a AdapterReport>) -> String {
    let list: Vec<String> = adapters.into_iter().map(|adapter| adapter.id().to_string()).collect();
    if list.is_empty() { "none".to_owned() } else { list.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: &[Precision] = &[Precision::F32, Precision::F64];
    const SINGLE: &[Precision] = &[Precision::F32];

    /// Adapters of a machine: name, model, kind, interface, address, precisions.
    type Row = (&'static str, u32, wgpu::DeviceType, wgpu::Backend, &'static str, &'static [Precision]);

    const SOFTWARE: Row = ("llvmpipe", 0, wgpu::DeviceType::Cpu, wgpu::Backend::Vulkan, "", BOTH);
    const INTEL: Row =
        ("Arc A770", 9, wgpu::DeviceType::DiscreteGpu, wgpu::Backend::Vulkan, "0000:03:00.0", SINGLE);

    fn big(pci: &'static str) -> Row {
        ("RTX 4090", 7, wgpu::DeviceType::DiscreteGpu, wgpu::Backend::Vulkan, pci, BOTH)
    }

    fn machine(rows: &[Row]) -> Vec<AdapterReport> {
        let report =
            |(number, &(name, device, kind, backend, pci, precisions)): (usize, &Row)| AdapterReport {
                number,
                info: wgpu::AdapterInfo {
                    name: name.to_owned(),
                    vendor: 1,
                    device,
                    device_pci_bus_id: pci.to_owned(),
                    ..wgpu::AdapterInfo::new(kind, backend)
                },
                precisions: precisions.to_vec(),
                largest_binding: 1 << 30,
                most_lanes: 1 << 19,
            };
        rows.iter().enumerate().map(report).collect()
    }

    fn taken(rows: &[Row], wanted: &str, environment: &str, precision: Precision) -> Result<Taken, String> {
        let wanted = (!wanted.is_empty()).then(|| wanted.parse().unwrap());
        let environment = match environment {
            "" => AdapterChoice::default(),
            name => AdapterChoice::named(name),
        };
        take(&machine(rows), wanted.as_ref(), &environment, precision).map_err(|error| error.to_string())
    }

    fn number(rows: &[Row], wanted: &str, environment: &str, precision: Precision) -> Result<usize, String> {
        taken(rows, wanted, environment, precision).map(|taken| taken.numbers[0])
    }

    #[test]
    fn a_software_driver_stands_in_for_no_card_in_silence() {
        let (here, double) = ([INTEL, SOFTWARE], Precision::F64);
        let error = number(&here, "", "", double).unwrap_err();
        assert_eq!(
            error,
            "no graphics card here has f64: 0 (Arc A770, PCI 0000:03:00.0); choose --engine cpu, which computes in \
             f64, --precision f32 or --adapter 1 (llvmpipe, a software driver)"
        );
        // Without a driver that has it, too.
        let error = number(&[INTEL], "", "", double).unwrap_err();
        assert!(error.ends_with("choose --engine cpu, which computes in f64 or --precision f32"), "{error}");
        // What is named is taken, and where there is no card there is nothing to be silent about.
        assert_eq!(number(&here, "1", "", double), Ok(1));
        assert_eq!(number(&here, "LLVM", "", double), Ok(1));
        assert_eq!(number(&here, "", "llvmpipe", double), Ok(1));
        assert_eq!(number(&[SOFTWARE], "", "", double), Ok(0));
        // A name that a card has, too, names no software driver.
        assert!(number(&here, "", "vulkan", double).unwrap_err().contains("no graphics card here"));
        // Another card may have it.
        assert_eq!(number(&[INTEL, big("a"), SOFTWARE], "", "", double), Ok(1));
        assert_eq!(number(&here, "", "", Precision::F32), Ok(0));
        let error = number(&here, "0", "", double).unwrap_err();
        assert!(error.starts_with("adapter 0 (Arc A770, PCI 0000:03:00.0) has no f64; choose "), "{error}");
        let error = number(&here, "", "nothing", double).unwrap_err();
        assert!(error.starts_with("no graphics adapter called nothing with double"), "{error}");
    }

    #[test]
    fn an_adapter_is_named_by_what_it_alone_has() {
        let here = [big("0000:17:00.0"), big("0000:65:00.0"), INTEL, SOFTWARE];
        let single = Precision::F32;
        assert_eq!(number(&here, "3", "", single), Ok(3));
        assert_eq!(number(&here, "arc", "", single), Ok(2));
        assert_eq!(number(&here, "65:00.0", "", single), Ok(1), "a part of the address is no number");
        // It goes before the environment.
        assert_eq!(number(&here, "arc", "llvmpipe", single), Ok(2));
        let error = number(&here, "RTX", "", single).unwrap_err();
        assert!(error.contains("give a number: 0 (RTX 4090, PCI 0000:17:00.0), 1 (RTX 4090"), "{error}");
        let error = number(&here, "4", "", single).unwrap_err();
        assert!(error.contains("no adapter has this number; there are: 0 (RTX 4090"), "{error}");
        let error = number(&here, "radeon", "", single).unwrap_err();
        assert!(error.contains("has this part; there are: 0 (RTX 4090"), "{error}");
        assert!(number(&[], "0", "", single).unwrap_err().ends_with("there are: none"));
        // One card by two interfaces is one card.
        let second = (INTEL.0, INTEL.1, INTEL.2, wgpu::Backend::Dx12, "", SINGLE);
        assert_eq!(number(&[INTEL, second], "arc", "", single), Ok(0));
        assert_eq!(number(&[INTEL, second], "dx12", "", single), Ok(1));
    }

    #[test]
    fn all_are_those_that_are_equal_to_the_first() {
        let other_interface = (INTEL.0, 7, INTEL.2, wgpu::Backend::Dx12, "", SINGLE);
        let twice = big("0000:17:00.0");
        let here = [big("0000:17:00.0"), twice, big("0000:65:00.0"), INTEL, other_interface, SOFTWARE];
        let all = taken(&here, "all", "", Precision::F64).unwrap();
        assert_eq!(all.numbers, [0, 2]);
        assert_eq!(
            all.left_out,
            [
                "adapter 3 (Arc A770, PCI 0000:03:00.0) is left out: it is of another model",
                "adapter 5 (llvmpipe) is left out: it is a software driver"
            ]
        );
        // The environment says which is the first.
        assert_eq!(taken(&here, "all", "arc", Precision::F32).unwrap().numbers, [3]);
        // Software drivers have no address.
        assert_eq!(taken(&[SOFTWARE, SOFTWARE], "all", "", Precision::F32).unwrap().numbers, [0, 1]);
        assert!(taken(&[INTEL, SOFTWARE], "all", "", Precision::F64).is_err());
    }

    #[test]
    fn what_is_asked_for_is_written_as_it_is_read() {
        for text in ["all", "12", "RTX 4090", "0000:65:00.0", "-1"] {
            assert_eq!(text.parse::<Wanted>().unwrap().to_string(), text);
        }
        assert_eq!("007".parse(), Ok(Wanted::Number(7)));
    }
}
