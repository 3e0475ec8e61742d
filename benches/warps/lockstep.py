"""Turns the PTX of the kernels into C++ that runs one lane through one basic block, so that `warp.h` can run warps in lockstep.

    lockstep.py FOLDER

For each kernel, the folder has KERNEL.ptx and its source KERNEL.cu, and gets KERNEL.cpp with a function for each block. A table has the
number of a block's instructions by phase, and the block where lanes that have parted meet again: its immediate post-dominator.
"""

import collections
import functools
import re
import sys
from pathlib import Path

KERNELS = ["sweep", "reading", "observe", "judge_cycles"]
# The phases of a lane's work, with the functions of the shader that begin them. A function that is not listed belongs to its caller.
PHASES = {
    "scan": "scan",
    "judging of stretches, with series": "first_event",
    "root search": "root",
    "tangents, columns": "glide_tangents jump_tangents step_columns check_range check_columns",
    "expansion": "expand",
    "rest of careful pass, state, bounds": "careful state_at derivative_bound renew_bound flight_to_chatter sweep reading",
    "contact law, word": "act enter count_event close_chatter",
    "judge cycle": "judge_cycles",
    "recurrence, strobe": "begin_period compare_mirror observe",
    "load and store of lanes": "load_lane store_lane load_strobe_state store_strobe_state load_tangent store_tangent_now "
    "resume_motion suspend_motion prepare_motion",
}
PHASE_OF = {function: n for n, functions in enumerate(PHASES.values()) for function in functions.split()}
# Largest number of calls that are followed from an inlined function to the kernel.
MOST_CALLS = 20

# C++ types of registers, by the letters of their names, and of operations.
TYPES = {"f": "float", "r": "uint32_t", "rd": "uint64_t", "rs": "uint16_t", "p": "bool", "pred": "bool", "f32": "float"}
TYPES |= {f"{kind}{bits}": f"{'int' if kind == 's' else 'uint'}{bits}_t" for kind in "sub" for bits in (8, 16, 32, 64)}
EXPRESSIONS = {
    "add": "{0} + {1}", "sub": "{0} - {1}", "mul": "{0} * {1}", "mad": "{0} * {1} + {2}", "fma": "std::fma({0}, {1}, {2})",
    "div": "{0} / {1}", "rem": "{0} % {1}", "rcp": "1 / {0}", "sqrt": "std::sqrt({0})", "rsqrt": "1 / std::sqrt({0})",
    "lg2": "std::log2({0})", "ex2": "std::exp2({0})", "neg": "-{0}", "abs": "std::abs({0})", "max": "std::max({0}, {1})",
    "max.f32": "std::fmax({0}, {1})", "min": "std::min({0}, {1})", "min.f32": "std::fmin({0}, {1})", "and": "{0} & {1}",
    "or": "{0} | {1}", "xor": "{0} ^ {1}", "not": "~{0}", "not.pred": "!{0}", "shl": "shifted_left({0}, {1})",
    "shr": "shifted_right({0}, {1})", "selp": "{2} ? {0} : {1}", "mov": "{0}", "cvta": "{0}",
}
# An ordered comparison is false, and an unordered one true, if a number is NaN.
COMPARISONS = {
    "eq": "{0} == {1}", "ne": "{0} < {1} || {0} > {1}", "lt": "{0} < {1}", "le": "{0} <= {1}", "gt": "{0} > {1}",
    "ge": "{0} >= {1}", "equ": "!({0} < {1} || {0} > {1})", "neu": "!({0} == {1})", "ltu": "!({0} >= {1})",
    "leu": "!({0} > {1})", "gtu": "!({0} <= {1})", "geu": "!({0} < {1})",
}

# `guard` is the condition of a branch. `code` has the parts of the operation's name.
Instruction = collections.namedtuple("Instruction", "guard code operands phase")


def functions_of_lines(source):
    """Returns the function that each line of a CUDA source belongs to, from line 1 on."""
    functions = [None]
    for line in source.split("\n"):
        begun = re.match(r"DEVICE [\w:]+ (\w+)\(", line)
        functions.append(begun[1] if begun else functions[-1])
    return functions


def basic_blocks(lines, functions, source, kernel):
    """Returns the blocks of instructions, and the block that each label begins. `source` is the number of the CUDA file."""
    blocks, labels, inlined_at, phase = [[]], {}, {}, PHASE_OF[kernel]
    for line in map(str.strip, lines):
        if location := re.match(r"\.loc\s+(\d+ \d+ \d+)(?:, function_name \S+, inlined_at (\d+ \d+ \d+))?", line):
            place, site = location.groups()
            if site:
                inlined_at[place] = site
            if place.split()[1] != "0":
                chain = []
                while place and len(chain) < MOST_CALLS:
                    file, number, _ = place.split()
                    chain.append(functions[int(number)] if file == source else None)
                    place = inlined_at.get(place)
                phase = next(PHASE_OF[function] for function in chain + [kernel] if function in PHASE_OF)
        elif line.startswith("$L"):
            labels[line.split(":")[0]] = len(blocks)
            blocks.append([])
        elif instruction := re.match(r"(@!?%p\d+)?\s*([a-z][\w.]*)\s*(.*);", line):
            guard, code, operands = instruction.groups()
            blocks[-1].append(Instruction(guard, code.split("."), re.findall(r"{.*?}|[^, ]+", operands), phase))
            if code.startswith("bra") or code == "ret":
                blocks.append([])
    return blocks, labels


def successors(n, block, labels, end):
    """Returns the blocks that may follow block `n`; first the target of its branch. `end` follows the last block."""
    if not block or block[-1].code[0] not in ("bra", "ret"):
        return [n + 1]
    guard, code, operands, _ = block[-1]
    targets = [end] if code[0] == "ret" else [labels[operands[0]]]
    return targets + [n + 1] if guard else targets


def post_dominators(following):
    """Returns the immediate post-dominator of each block."""
    end = len(following)
    # Bit k of a block's set: every way from the block to the end passes block k.
    sets, before = [(1 << end + 1) - 1] * end + [1 << end], None
    while sets != before:
        before = list(sets)
        for n in reversed(range(end)):
            sets[n] = functools.reduce(int.__and__, (sets[k] for k in following[n])) | 1 << n
    # From the immediate post-dominator, every way passes all others.
    sizes = [passed.bit_count() for passed in sets]
    return [max((k for k in range(end + 1) if sets[n] >> k & 1 and k != n), key=sizes.__getitem__) for n in range(end)]


def name(register):
    return "lane." + register.lstrip("@!%").replace(".", "_")


def value(operand, of):
    """Returns an operand as a C++ expression of a PTX type."""
    if operand.startswith("%"):
        operand = name(operand)
    elif operand.startswith("0f"):
        operand = f"0x{operand[2:]}u"
    elif parameter := re.fullmatch(r"\w+_param_(\d+)", operand):
        operand = f"uint64_t(parameters[{parameter[1]}])"
    elif operand.startswith("__local_depot"):
        operand = "uint64_t(lane.stack)"
    elif not re.fullmatch(r"-?\d+", operand):
        raise ValueError(f"unknown operand {operand}")
    return f"as<{TYPES[of]}>({operand})"


def access(code, operands):
    """Returns a load, or a store, of one or several neighbouring numbers as C++ statements."""
    registers, place = operands if code[0] == "ld" else reversed(operands)
    base, offset = re.fullmatch(r"\[([^+\]]+)(?:\+(-?\d+))?\]", place).groups()
    of = TYPES[code[-1]]
    for n, register in enumerate(re.findall(r"[^{}, ]+", registers)):
        # All numbers of an access are in one line.
        where = "global" if "global" in code and n == 0 else "at"
        memory = f"{where}<{of}>({value(base, 'u64')} + {offset or 0} + {n} * sizeof({of}))"
        yield f"set({name(register)}, {memory});" if code[0] == "ld" else f"{memory} = {value(register, code[-1])};"


def result(code, operands):
    """Returns the result of an operation as a C++ expression."""
    root, of = code[0], code[-1]
    if root == "cvt":
        return f"converted_{code[1] if len(code) > 3 else 'rn'}<{TYPES[code[-2]]}>({value(operands[0], of)})"
    if root == "setp":
        comparison = {"lo": "lt", "ls": "le", "hi": "gt", "hs": "ge"}.get(code[1], code[1])
        form = "{0} != {1}" if comparison == "ne" and of != "f32" else COMPARISONS[comparison]
    elif root not in EXPRESSIONS or "hi" in code:
        raise ValueError(f"unknown operation {'.'.join(code)}")
    else:
        form = EXPRESSIONS.get(f"{root}.{of}", EXPRESSIONS[root])
    types = {"shl": [of, "u32"], "shr": [of, "u32"], "selp": [of, of, "pred"]}.get(root, [of] * 3)
    wide = TYPES[{"u16": "u32", "s32": "s64", "u32": "u64"}[of]] if "wide" in code else ""
    return form.format(*(f"{wide}({value(operand, type)})" for operand, type in zip(operands, types)))


def statement(instruction, nexts):
    """Returns an instruction as a C++ statement. `nexts` are the blocks that may follow its block."""
    guard, code, operands, _ = instruction
    if code[0] in ("bra", "ret"):
        condition = f"if ({'!' if '!' in guard else ''}{name(guard)}) " if guard else ""
        return f"{condition}return {nexts[0]};"
    if guard:
        raise ValueError(f"only branches may have a condition: {instruction}")
    if code[0] in ("ld", "st"):
        return " ".join(access(code, operands))
    return f"set({name(operands[0])}, {result(code, operands[1:])});"


def program(kernel, ptx, cuda):
    """Returns the C++ of a kernel, line by line."""
    source = re.search(rf'\.file\s+(\d+) "[^"]*{kernel}\.cu"', ptx)[1]
    stack = re.search(r"__local_depot0\[(\d+)\]", ptx)
    lines = ptx.split("\n")
    body = lines[lines.index("{") + 1 : lines.index("}")]
    blocks, labels = basic_blocks(body, functions_of_lines(cuda), source, kernel)
    following = [successors(n, block, labels, len(blocks)) for n, block in enumerate(blocks)]
    yield from ['#include "warp.h"', "namespace {", "struct Lane : Place {"]
    for kind, n in sorted(set(re.findall(r"%(f|rd|rs|r|p)(\d+)\b", "\n".join(body)))):
        yield f"{TYPES[kind]} {kind}{n};"
    yield f"alignas(16) char stack[{stack[1] if stack else 1}];\n}};"
    for n, (block, nexts) in enumerate(zip(blocks, following)):
        yield from [f"int block_{n}(Lane& lane) {{", *(statement(one, nexts) for one in block), f"return {n + 1};\n}}"]
    yield "const Block<Lane> BLOCKS[] = {"
    for n, (block, meet) in enumerate(zip(blocks, post_dominators(following))):
        counts = collections.Counter(instruction.phase for instruction in block).items()
        yield f"{{block_{n}, {meet}, {{{', '.join(f'{{{phase}, {count}}}' for phase, count in counts)}}}}},"
    yield f"}};\n}}\nconst Program {kernel} = run_warp<Lane, BLOCKS, std::size(BLOCKS)>;"


def main(folder):
    sources = {kernel: (folder / f"{kernel}.cu").read_text() for kernel in KERNELS}
    if missing := [function for function in PHASE_OF if f" {function}(" not in "".join(sources.values())]:
        sys.exit(f"error: the shader no longer has {', '.join(missing)}; change PHASES in lockstep.py")
    (folder / "phases.h").write_text("const char* const PHASES[] = {" + ", ".join(f'"{phase}"' for phase in PHASES) + "};\n")
    for kernel, cuda in sources.items():
        text = "\n".join(program(kernel, (folder / f"{kernel}.ptx").read_text(), cuda))
        (folder / f"{kernel}.cpp").write_text(text + "\n")


main(Path(sys.argv[1]))
