"""Messages of the program in the terms of Python: options become arguments, commands become calls."""

from __future__ import annotations

import re
import shlex

#: Options without a value.
_FLAGS = frozenset(("force", "resume", "repair"))
#: Options with a value, and the values that a message names.
_VALUES = {
    "engine": re.compile(r"auto|cpu|gpu"),
    "precision": re.compile(r"f32|f64"),
    "adapter": re.compile(r"\d+"),
    "along": re.compile(r".+"),
    "at": re.compile(r".+=.+"),
    "set": re.compile(r".+=.+"),
}
#: Other arguments of the package's functions.
_NAMES = frozenset(("out", "samples", "seed", "start", "periods", "transient", "adapters", "memory", "threads"))
#: Commands that are functions of the package.
_FUNCTIONS = frozenset(("map", "check", "validate", "compare", "devices"))

#: The argument that a message is about: ``--out DIR: the folder is not empty``.
_PLACE = re.compile(r"--([a-z-]+) (.+?)(?=: )")
_OPTION = re.compile(r"(?<![\w-])--([a-z][a-z-]*)(?:(?=:)| ([^\s,;:()]+))?")


def in_python(message: str) -> str:
    """Return a message of the program with arguments and functions of this package instead of options and commands."""
    place = _PLACE.match(message)
    start = "" if place is None else _argument(place[1], place[2])
    parts = message[len(place[0]) if place is not None else 0 :].split("`")
    parts[::2] = [_OPTION.sub(_option, part) for part in parts[::2]]
    parts[1::2] = [_call(part) if part.startswith("rattlemap ") else part for part in parts[1::2]]
    return start + "`".join(parts)


def _argument(name: str, value: str) -> str:
    """Return an option and its value as an argument. A setting of a parameter is one already."""
    if name == "set":
        return value
    if name == "at":
        parameter, _, number = value.partition("=")
        return f'at={{"{parameter}": {number}}}'
    return f"{name}={value}" if value.isdecimal() else f'{name}="{value}"'


def _option(found: re.Match[str]) -> str:
    name, value = found[1], found[2]
    if name in _FLAGS:
        return f"{name}=True" + ("" if value is None else f" {value}")
    if value is not None and name in _VALUES and _VALUES[name].fullmatch(value):
        return _argument(name, value)
    if name not in _VALUES and name not in _NAMES:
        return found[0]
    is_place = found.string[found.end() : found.end() + 1] == ":"
    return name + ("" if is_place else "=") + ("" if value is None else f" {value}")


def _call(command: str) -> str:
    """Return a command of the program as a call, if the package has a function for it."""
    try:
        _, name, *words = shlex.split(command)
    except ValueError:
        return command
    if name not in _FUNCTIONS or "--shard" in words:
        return command
    arguments, sets = [], []
    while words:
        word = words.pop(0)
        option = word.removeprefix("--")
        if option in _FLAGS:
            arguments.append(f"{option}=True")
        elif word == "--set" and words:
            sets.append(words.pop(0))
        elif word.startswith("--") and words:
            arguments.append(_argument(option, words.pop(0)))
        else:
            arguments.append("..." if word.isupper() else f'"{word}"')
    if sets:
        arguments.append("set=[" + ", ".join(f'"{text}"' for text in sets) + "]")
    return f"rm.{name}({', '.join(arguments)})"
