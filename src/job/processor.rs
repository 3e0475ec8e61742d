//! The host's processor: what it is called, how much of it there is, and whether the program can run on it.

#[cfg(target_arch = "x86_64")]
use raw_cpuid::native_cpuid::cpuid_count;

/// What is said on a processor for which the program was not built.
pub const MISFIT: &str = "error: this program was built for processors with AVX2 and FMA, and this one lacks them; build it \
                          for this one, in its sources: RUSTFLAGS=\"\" cargo install --path .\n";

/// Whether the processor has the instructions that the compiler was told to use. To be asked before anything else, which
/// would end the process without a word; for the same reason it does next to nothing.
#[cfg(target_arch = "x86_64")]
pub fn is_fit() -> bool {
    // Leaf 1, ecx and leaf 7, ebx: Intel, Software developer's manual 2A, CPUID. Not `is_x86_feature_detected`, which
    // believes the compiler.
    const FMA: u32 = 1 << 12;
    const AVX2: u32 = 1 << 5;
    let lacks_fma = cfg!(target_feature = "fma") && cpuid_count(1, 0).ecx & FMA == 0;
    let has_leaf = cpuid_count(0, 0).eax >= 7;
    let lacks_avx2 = cfg!(target_feature = "avx2") && !(has_leaf && cpuid_count(7, 0).ebx & AVX2 != 0);
    !(lacks_fma || lacks_avx2)
}

/// Others are built for what all of their kind have.
#[cfg(not(target_arch = "x86_64"))]
pub fn is_fit() -> bool {
    true
}

/// Threads that may run at a time.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Its name as it gives it, which may be empty; none if there is no telling.
pub fn name() -> Option<String> {
    let mut system = sysinfo::System::new();
    system.refresh_cpu_list(sysinfo::CpuRefreshKind::nothing());
    system.cpus().first().map(|cpu| cpu.brand().trim().to_owned())
}

/// Name and cores, in words.
pub fn described() -> String {
    let cores = cores();
    let named = name().filter(|name| !name.is_empty());
    named.map_or_else(|| format!("{cores} cores"), |name| format!("{name}, {cores} cores"))
}
