"""Turns an entry point that naga has translated to Metal into CUDA C++, which is C++ for the host as well.

    cuda.py ENTRY.metal ENTRY.cu

Metal is C++ with address spaces and attributes. They are taken out, and `cuda.h` defines Metal's vectors and functions.
"""

import re
import sys
from pathlib import Path

# Every kernel gets all buffers.
BUFFERS = "settings cells motions tallies queue starts shapes flows pairs laws block_starts".split()


def translated(text):
    """Returns the declarations and functions of a Metal source as C++."""
    text = text.split("using metal::uint;", 1)[1]
    text = re.sub(r"\[\[[^\]]*\]\]", "", text)
    text = text.replace("as_type<", "bits_as<")
    # WGSL aligns the structs of lanes. Metal has padding instead.
    text = re.sub(r"\bstruct (Motion|MotionNow|Measures|Tally|TallyNow|Search|Cell|Law|Domain) ", r"struct alignas(16) \1 ", text)
    text = re.sub(r"\bchar (_pad\d+)\[(\d+)\]", lambda pad: f"uint {pad[1]}[{int(pad[2]) // 4}]", text)
    text = re.sub(r"\bconstant (\w+)& ", r"const \1& ", text)
    text = re.sub(r"\bconstant ", "CONSTANT ", text)
    text = re.sub(r"\b(device|thread) ", "", text)
    text = re.sub(r"\b(\w+) const& (\w+)", r"const \1& \2", text)
    text = re.sub(r"(?<!::)\buint2\b", "metal::uint2", text)
    # Naga has several names for equal arrays and copies one to the other.
    text = re.sub(r"struct (\w+) \{\n    (\w+) inner\[(\d+)\];\n\};", r"typedef Array<\2, \3> \1;", text)
    # Metal reads decimal numbers as f32.
    text = re.sub(r"(?<![\w.])(\d+\.\d*(?:e[+-]?\d+)?|\d+e[+-]?\d+)(?![\w.])", r"\1f", text)
    # Functions begin in the first column.
    text = re.sub(r"^kernel void \w+\(", "DEVICE void body(", text, flags=re.M)
    return re.sub(r"^((?!DEVICE|CONSTANT|struct|typedef)[\w:]+ \w+\()", r"DEVICE \1", text, flags=re.M)


def entry_point(text, name):
    """Returns the CUDA kernel that calls `body`, and a function for the host that does the same for one invocation."""
    signature = text.split("DEVICE void body(", 1)[1].split(") {", 1)[0]
    types = {}
    for parameter in signature.replace("\n", " ").split(","):
        of, parameter = parameter.strip().rsplit(" ", 1)
        types[parameter] = of.rstrip("& ")
    arguments = ", ".join({"id": "id", "_buffer_sizes": "{}"}.get(name, f"*{name}") for name in types)
    buffers = [(types.get(buffer, "char"), buffer) for buffer in BUFFERS]
    of_kernel = ", ".join(f"{of}* __restrict__ {buffer}" for of, buffer in buffers[1:])
    of_host = "\n".join(f"    auto {buffer} = ({of}*)buffers[{n}];" for n, (of, buffer) in enumerate(buffers))
    return f"""
#ifdef __CUDACC__
extern "C" __global__ void __launch_bounds__(WORKGROUP) {name}(const __grid_constant__ Settings uniform, {of_kernel}) {{
    const Settings* settings = &uniform;
    metal::uint3 id{{blockIdx.x * WORKGROUP + threadIdx.x, blockIdx.y, 0u}};
    body({arguments});
}}
#else
inline void run(uint invocation, void* const* buffers) {{
{of_host}
    metal::uint3 id{{invocation, 0u, 0u}};
    body({arguments});
}}
#endif
"""


source, target = map(Path, sys.argv[1:])
text = translated(source.read_text())
target.write_text('#include "cuda.h"\n' + text + entry_point(text, source.stem))
