//! The host's processor: what it is called, and how much of it there is.

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
pub(crate) fn described() -> String {
    let cores = cores();
    let named = name().filter(|name| !name.is_empty());
    named.map_or_else(|| format!("{cores} cores"), |name| format!("{name}, {cores} cores"))
}
