//! Errors of the GPU engine, in words for users.

/// An error of the GPU engine.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// No adapter fits the request.
    #[error("no graphics adapter {wanted}; {remedy}, or use the CPU engine. Found: {found}")]
    NoAdapter {
        /// The request, in words.
        wanted: String,
        /// How to get such an adapter.
        remedy: String,
        /// Adapters of this machine.
        found: String,
    },
    /// The adapter opens no device.
    #[error("the adapter {adapter} opens no device: {reason}")]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// Message of the driver.
        reason: String,
    },
    /// The device refused a shader, a buffer or a command.
    #[error("the device refused {what}: {message}")]
    Refused {
        /// The refused shader, buffer or command.
        what: &'static str,
        /// Message of the driver.
        message: String,
    },
    /// The device has too little memory.
    #[error("the device has no memory for {count} {what}; use fewer at a time")]
    OutOfMemory {
        /// "lanes" or "flows".
        what: &'static str,
        /// Number of these.
        count: usize,
    },
    /// The device was lost.
    #[error("the device was lost: {message}")]
    Lost {
        /// Message of the driver.
        message: String,
    },
    /// The stop flag of the device was set.
    #[error("stopped on request")]
    Halted,
    /// The device does not reproduce a known answer.
    #[error(
        "{adapter} computes the known answer at e = {e}, omega = {omega} with an error of {error:.1e}: its driver cannot be \
         trusted; choose another adapter or the CPU engine"
    )]
    WrongAnswer {
        /// Name of the adapter.
        adapter: String,
        /// Restitution of the cell.
        e: f64,
        /// Frequency of the cell.
        omega: f64,
        /// Error of the state.
        error: f64,
    },
    /// Constants of the flows exceed the largest buffer.
    #[error(
        "{flows} flows need {needed} bytes in one buffer, but the adapter allows {allowed}; run fewer flows at a time"
    )]
    TooManyFlows {
        /// Number of flows.
        flows: usize,
        /// Number of bytes that the flows need.
        needed: u64,
        /// Number of bytes that the adapter allows.
        allowed: u64,
    },
    /// A flow has a feature that the settings exclude.
    #[error("flow {flow} has {feature}, which the settings exclude; set `features.{setting}`")]
    NotCompiled {
        /// Index of the flow.
        flow: usize,
        /// The feature in words.
        feature: &'static str,
        /// The setting that includes it.
        setting: &'static str,
    },
    /// A lane refers to a flow or a law that is not in the tables.
    #[error("lane {lane} refers to flow {flow} and law {law}, but there are {flows} flows and {laws} laws")]
    NoSuchCell {
        /// Index of the lane.
        lane: usize,
        /// Index of its flow.
        flow: u32,
        /// Index of its law.
        law: u32,
        /// Number of flows.
        flows: usize,
        /// Number of laws.
        laws: usize,
    },
}
