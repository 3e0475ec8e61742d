//! Why a graphics device cannot do what is asked, in words for users.

/// Why the engine could not do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// No adapter fits.
    #[error("no graphics adapter {wanted}; {remedy}, or use the CPU engine. Found: {found}")]
    NoAdapter {
        /// What was asked for.
        wanted: String,
        /// What may give one.
        remedy: String,
        /// What there is.
        found: String,
    },
    /// The adapter gives no device.
    #[error("the adapter {adapter} gives no device: {reason}")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// The driver's words.
        reason: String,
    },
    /// The device refused a shader, a buffer or a command.
    #[error("the device refused {what}: {message}")]
    Refused {
        /// What was asked of it.
        what: &'static str,
        /// Its words.
        message: String,
    },
    /// The device ran out of memory.
    #[error("the device has no memory for {count} {what}; ask for fewer at a time")]
    OutOfMemory {
        /// Lanes or flows.
        what: &'static str,
        /// How many.
        count: usize,
    },
    /// The device was lost on the way.
    #[error("the device was lost on the way: {message}")]
    Lost {
        /// The driver's words.
        message: String,
    },
    /// Somebody raised the flag that the device heeds.
    #[error("stopped on demand")]
    Halted,
    /// The device computes something else than what is known.
    #[error(
        "{adapter} fails the known answer of e = {e}, omega = {omega} by {error:.1e}: its driver cannot be trusted; \
         choose another adapter or the CPU engine"
    )]
    WrongAnswer {
        /// Name of the adapter.
        adapter: String,
        /// Restitution of the cell.
        e: f64,
        /// Frequency of the cell.
        omega: f64,
        /// State error.
        error: f64,
    },
    /// Constants of the flows exceed what one buffer may hold.
    #[error(
        "{flows} flows need {needed} bytes in one buffer, the adapter allows {allowed}; run fewer flows at a time"
    )]
    TooManyFlows {
        /// Number of flows.
        flows: usize,
        /// Bytes they need.
        needed: u64,
        /// Bytes the adapter allows.
        allowed: u64,
    },
    /// Walls that the settings have left out.
    #[error("flow {flow} has an elastic or a rigid wall, and the settings say that there is none")]
    NotCompiled {
        /// Index of the flow.
        flow: usize,
    },
    /// A lane names a flow or law that was not handed in.
    #[error("lane {lane} names flow {flow} and law {law}, but there are {flows} flows and {laws} laws")]
    NoSuchCell {
        /// The lane.
        lane: usize,
        /// Its flow.
        flow: u32,
        /// Its law.
        law: u32,
        /// Flows there are.
        flows: usize,
        /// Laws there are.
        laws: usize,
    },
}
