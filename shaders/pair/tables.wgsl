// Constants of a flow of an oscillator with one gap, as lanes read them.

@group(0) @binding(1) var<storage, read> flows: array<Flow>;
@group(0) @binding(2) var<storage, read> shapes: array<FlowShape>;
@group(0) @binding(3) var<storage, read> pairs: array<array<Real, 2>>;
@group(0) @binding(4) var<storage, read> laws: array<Law>;

// Modes of the motion. For all modes except the first, add the side: mode + SIDE_*.
const MODE_FREE: u32 = 0u;
const MODE_SUSTAINED: u32 = 1u;
const MODE_ONSET: u32 = 3u;
const MODE_STUCK: u32 = 5u;

const SIDE_RIGHT: u32 = 0u;
const SIDE_LEFT: u32 = 1u;
const SIDE_NONE: u32 = 2u;
