//! The host's processor: its name, its cores, and whether it can run the program.

use std::error::Error;
use std::sync::OnceLock;

#[cfg(target_arch = "x86_64")]
use raw_cpuid::native_cpuid::cpuid_count;

/// The message for a processor that lacks the instructions that the program was compiled for.
pub const MISFIT: &str = "error: this program was built for processors with AVX2 and FMA, and this one lacks them; build it \
                          for this one in the source folder: RUSTFLAGS=\"\" cargo install --path .\n";

/// Whether the processor has the instructions that the program was compiled for. Call it first: a missing instruction
/// ends the process without a message. This function itself is too short to contain such instructions.
#[cfg(target_arch = "x86_64")]
pub fn is_fit() -> bool {
    // Leaf 1, ecx and leaf 7, ebx: Intel, Software developer's manual 2A, CPUID. `is_x86_feature_detected` would return
    // the compiler's settings.
    const FMA: u32 = 1 << 12;
    const AVX2: u32 = 1 << 5;
    let lacks_fma = cfg!(target_feature = "fma") && cpuid_count(1, 0).ecx & FMA == 0;
    let has_leaf = cpuid_count(0, 0).eax >= 7;
    let lacks_avx2 = cfg!(target_feature = "avx2") && !(has_leaf && cpuid_count(7, 0).ebx & AVX2 != 0);
    !(lacks_fma || lacks_avx2)
}

/// Returns true: programs for other architectures use no optional instructions.
#[cfg(not(target_arch = "x86_64"))]
pub fn is_fit() -> bool {
    true
}

/// Largest number of threads of a computation; more cores than any machine has.
const MOST_THREADS: usize = 1024;

/// Number of threads that can run at a time.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Starts the threads that all computations share, unless they have been started.
///
/// # Errors
/// The message, if the system refuses, or if too many are asked for.
pub fn start_threads() -> Result<(), String> {
    // Threads that could not be started cannot be started later.
    static STARTED: OnceLock<Result<(), String>> = OnceLock::new();
    let asked = std::env::var("RAYON_NUM_THREADS").ok().and_then(|text| text.parse::<usize>().ok());
    if let Some(asked) = asked.filter(|&asked| asked > MOST_THREADS) {
        return Err(format!("RAYON_NUM_THREADS={asked}: it must be at most {MOST_THREADS}"));
    }
    let start = || match rayon::ThreadPoolBuilder::new().build_global() {
        Err(error) if error.source().is_some() => Err(format!(
            "cannot start a thread on each core ({error}); raise the limits of this shell (`ulimit -u` and `ulimit -v`), or \
             use fewer threads: set RAYON_NUM_THREADS to a small number"
        )),
        // An error without a source says that there are threads already.
        _ => Ok(()),
    };
    STARTED.get_or_init(start).clone()
}

/// Name that the processor reports, which may be empty. None if it cannot be found.
pub fn name() -> Option<String> {
    let mut system = sysinfo::System::new();
    system.refresh_cpu_list(sysinfo::CpuRefreshKind::nothing());
    system.cpus().first().map(|cpu| cpu.brand().trim().to_owned())
}

/// Describes the processor in messages: name and number of cores.
pub fn described() -> String {
    let cores = cores();
    let named = name().filter(|name| !name.is_empty());
    named.map_or_else(|| format!("{cores} cores"), |name| format!("{name}, {cores} cores"))
}
