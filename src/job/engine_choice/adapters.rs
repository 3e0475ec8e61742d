//! Selects the graphics adapter that computes a map.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use crate::gpu::{self, AdapterChoice, AdapterReport, GpuError, Precision};

/// A request for a graphics adapter. It takes precedence over the environment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AdapterRequest {
    /// The adapter with this number, see [`AdapterReport::number`].
    Number(usize),
    /// The only adapter whose name, driver or PCI address contains this text; case is ignored.
    Named(String),
}

/// A text that requests no single adapter.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum AdapterTextError {
    /// The text is blank.
    #[error("it must be a number or part of a name that `rattlemap devices` lists")]
    Blank,
    /// The text is `all`.
    #[error(
        "one process computes on one adapter; compute one shard per adapter and merge them, for two cards: \
         `rattlemap map SCENE --engine gpu --shard 1/2 --adapter 0`, the same with `--shard 2/2 --adapter 1`, then \
         `rattlemap merge OUT PART PART`"
    )]
    All,
}

impl FromStr for AdapterRequest {
    type Err = AdapterTextError;

    fn from_str(text: &str) -> Result<AdapterRequest, AdapterTextError> {
        match (text, text.parse()) {
            ("all", _) => Err(AdapterTextError::All),
            (blank, _) if blank.trim().is_empty() => Err(AdapterTextError::Blank),
            (_, Ok(number)) => Ok(AdapterRequest::Number(number)),
            (name, Err(_)) => Ok(AdapterRequest::Named(name.to_owned())),
        }
    }
}

impl fmt::Display for AdapterRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AdapterRequest::Number(number) => write!(f, "{number}"),
            AdapterRequest::Named(name) => f.write_str(name),
        }
    }
}

/// An error in selecting an adapter.
#[derive(Debug, Error)]
pub enum AdapterError {
    /// No adapter has this number.
    #[error("--adapter {number}: no adapter has this number; the adapters are: {list}")]
    NoSuchNumber {
        /// The number.
        number: usize,
        /// Numbers and names of all adapters.
        list: String,
    },
    /// No adapter contains this text.
    #[error(
        "--adapter {name}: no adapter's name, driver or PCI address contains this text; the adapters are: {list}"
    )]
    NoneCalled {
        /// The text.
        name: String,
        /// Numbers and names of all adapters.
        list: String,
    },
    /// Several adapters contain this text.
    #[error("--adapter {name}: more than one adapter contains this text; give a number: {list}")]
    Ambiguous {
        /// The text.
        name: String,
        /// Numbers and names of the adapters that contain it.
        list: String,
    },
    /// The requested adapter lacks the precision.
    #[error("adapter {adapter} has no {precision}; give {remedies}")]
    Lacks {
        /// Number and name of the adapter.
        adapter: String,
        /// The precision.
        precision: &'static str,
        /// Requests that would succeed.
        remedies: String,
    },
    /// No hardware adapter has the precision. A software driver is used only on request: it may be slower by orders of
    /// magnitude.
    #[error("no graphics card has {precision} ({cards}); give {remedies}")]
    NoCardHas {
        /// The precision.
        precision: &'static str,
        /// Numbers and names of the hardware adapters.
        cards: String,
        /// Requests that would succeed.
        remedies: String,
    },
    /// There is no adapter.
    #[error(transparent)]
    None(GpuError),
}

/// Selects the requested adapter, or without a request the best adapter that the environment allows.
///
/// # Errors
/// [`AdapterError`].
pub(crate) fn select<'a>(
    all: &'a [AdapterReport],
    request: Option<&AdapterRequest>,
    environment: &AdapterChoice,
    precision: Precision,
) -> Result<&'a AdapterReport, AdapterError> {
    let Some(request) = request else { return best(all, environment, precision) };
    let found = request.among(all)?;
    if found.precisions.contains(&precision) {
        return Ok(found);
    }
    Err(AdapterError::Lacks {
        adapter: found.id().to_string(),
        precision: precision.name(),
        remedies: remedies(precision, all),
    })
}

impl AdapterRequest {
    /// Returns the adapter of the list that matches the request. Precisions are not checked.
    ///
    /// # Errors
    /// [`AdapterError`] if no adapter matches, or if several match a name.
    pub fn among<'a>(&self, all: &'a [AdapterReport]) -> Result<&'a AdapterReport, AdapterError> {
        match self {
            &AdapterRequest::Number(number) => {
                let found = all.iter().find(|adapter| adapter.number == number);
                found.ok_or_else(|| AdapterError::NoSuchNumber { number, list: listed(all) })
            }
            AdapterRequest::Named(name) => called(name, all),
        }
    }
}

/// Returns the first adapter that the environment allows and that has the precision. A software driver is returned only
/// where no hardware adapter is allowed.
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

/// Returns the adapter that contains this text. If a card is listed by several interfaces, the first and best one counts.
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

/// Whether two adapters are the same card: two interfaces list it, or one lists it twice. Some interfaces do not report
/// the model.
fn is_same_card(one: &AdapterReport, other: &AdapterReport) -> bool {
    let (one, other) = (&one.info, &other.info);
    if one.backend != other.backend {
        return one.vendor == other.vendor
            && (one.device == other.device || one.device.min(other.device) == 0);
    }
    // Interfaces other than Vulkan report one address for several equal cards.
    let has_address = one.backend == wgpu::Backend::Vulkan && !one.device_pci_bus_id.is_empty();
    has_address && one.device_pci_bus_id == other.device_pci_bus_id
}

fn is_hardware(adapter: &AdapterReport) -> bool {
    gpu::is_hardware(&adapter.info)
}

/// Lists the requests that would succeed if the precision is missing.
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

/// Returns numbers and names, separated by commas.
fn listed<'a>(adapters: impl IntoIterator<Item = &'a AdapterReport>) -> String {
    let list: Vec<String> = adapters.into_iter().map(|adapter| adapter.id().to_string()).collect();
    if list.is_empty() { "none".to_owned() } else { list.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: &[Precision] = &[Precision::F32, Precision::F64];
    const SINGLE: &[Precision] = &[Precision::F32];

    /// One adapter: name, model, kind, interface, address, precisions.
    type AdapterRow =
        (&'static str, u32, wgpu::DeviceType, wgpu::Backend, &'static str, &'static [Precision]);

    const SOFTWARE: AdapterRow = ("llvmpipe", 0, wgpu::DeviceType::Cpu, wgpu::Backend::Vulkan, "", BOTH);
    const INTEL: AdapterRow =
        ("Arc A770", 9, wgpu::DeviceType::DiscreteGpu, wgpu::Backend::Vulkan, "0000:03:00.0", SINGLE);

    fn big(pci: &'static str) -> AdapterRow {
        ("RTX 4090", 7, wgpu::DeviceType::DiscreteGpu, wgpu::Backend::Vulkan, pci, BOTH)
    }

    fn machine(rows: &[AdapterRow]) -> Vec<AdapterReport> {
        let report =
            |(number, &(name, device, kind, backend, pci, precisions)): (usize, &AdapterRow)| AdapterReport {
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

    fn number(
        rows: &[AdapterRow],
        request: &str,
        environment: &str,
        precision: Precision,
    ) -> Result<usize, String> {
        let request = (!request.is_empty()).then(|| request.parse().unwrap());
        let environment = match environment {
            "" => AdapterChoice::default(),
            name => AdapterChoice::named(name),
        };
        let all = machine(rows);
        let selected = select(&all, request.as_ref(), &environment, precision);
        selected.map(|adapter| adapter.number).map_err(|error| error.to_string())
    }

    #[test]
    fn a_software_driver_beside_hardware_is_used_only_by_request() {
        let (here, double) = ([INTEL, SOFTWARE], Precision::F64);
        let error = number(&here, "", "", double).unwrap_err();
        assert_eq!(
            error,
            "no graphics card has f64 (0 (Arc A770, PCI 0000:03:00.0)); give --engine cpu, which computes in f64, \
             --precision f32 or --adapter 1 (llvmpipe, a software driver)"
        );
        // The message is the same without a software driver.
        let error = number(&[INTEL], "", "", double).unwrap_err();
        assert!(error.ends_with("give --engine cpu, which computes in f64 or --precision f32"), "{error}");
        // A software driver is used by name, and where there is no card.
        assert_eq!(number(&here, "1", "", double), Ok(1));
        assert_eq!(number(&here, "LLVM", "", double), Ok(1));
        assert_eq!(number(&here, "", "llvmpipe", double), Ok(1));
        assert_eq!(number(&[SOFTWARE], "", "", double), Ok(0));
        // A name in the environment that also matches a card does not select the software driver.
        assert!(number(&here, "", "vulkan", double).unwrap_err().contains("no graphics card has"));
        // Another card has the precision.
        assert_eq!(number(&[INTEL, big("a"), SOFTWARE], "", "", double), Ok(1));
        assert_eq!(number(&here, "", "", Precision::F32), Ok(0));
        let error = number(&here, "0", "", double).unwrap_err();
        assert!(error.starts_with("adapter 0 (Arc A770, PCI 0000:03:00.0) has no f64; give "), "{error}");
        let error = number(&here, "", "nothing", double).unwrap_err();
        assert!(error.starts_with("no graphics adapter called nothing with double"), "{error}");
    }

    #[test]
    fn a_name_must_match_one_adapter_only() {
        let here = [big("0000:17:00.0"), big("0000:65:00.0"), INTEL, SOFTWARE];
        let single = Precision::F32;
        assert_eq!(number(&here, "3", "", single), Ok(3));
        assert_eq!(number(&here, "arc", "", single), Ok(2));
        assert_eq!(number(&here, "65:00.0", "", single), Ok(1), "a part of the address is not a number");
        // The request takes precedence over the environment.
        assert_eq!(number(&here, "arc", "llvmpipe", single), Ok(2));
        let error = number(&here, "RTX", "", single).unwrap_err();
        assert!(error.contains("give a number: 0 (RTX 4090, PCI 0000:17:00.0), 1 (RTX 4090"), "{error}");
        let error = number(&here, "4", "", single).unwrap_err();
        assert!(error.contains("no adapter has this number; the adapters are: 0 (RTX 4090"), "{error}");
        let error = number(&here, "radeon", "", single).unwrap_err();
        assert!(error.contains("contains this text; the adapters are: 0 (RTX 4090"), "{error}");
        assert!(number(&[], "0", "", single).unwrap_err().ends_with("the adapters are: none"));
        // A card that two interfaces list counts once.
        let second = (INTEL.0, INTEL.1, INTEL.2, wgpu::Backend::Dx12, "", SINGLE);
        assert_eq!(number(&[INTEL, second], "arc", "", single), Ok(0));
        assert_eq!(number(&[INTEL, second], "dx12", "", single), Ok(1));
    }

    #[test]
    fn requests_survive_writing_and_reading() {
        for text in ["12", "RTX 4090", "0000:65:00.0", "-1"] {
            assert_eq!(text.parse::<AdapterRequest>().unwrap().to_string(), text);
        }
        assert_eq!("007".parse(), Ok(AdapterRequest::Number(7)));
        assert_eq!("all".parse::<AdapterRequest>(), Err(AdapterTextError::All));
        assert_eq!(" ".parse::<AdapterRequest>(), Err(AdapterTextError::Blank));
    }
}
