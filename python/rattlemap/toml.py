"""Values as TOML text, which reads back as the same bits."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Table = dict[str, Any]


def value_text(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(name)} = {value_text(item)}" for name, item in value.items()) + "}"
    if isinstance(value, (Sequence, np.ndarray)) and np.ndim(value) > 0:
        return "[" + ", ".join(map(value_text, value)) + "]"
    return number_text(value)


def number_text(value: Any) -> str:
    """Return the shortest decimal that reads back as the same number. Other values become text, which the program refuses."""
    try:
        return repr(float(value))
    except (TypeError, ValueError):
        return value_text(str(value))


def number_or_text(value: Any) -> Any:
    """Return a number, or text, which the program refuses."""
    if isinstance(value, str):
        return value
    try:
        return float(value)
    except (TypeError, ValueError):
        return str(value)


def assignments(parameters: Mapping[str, Any]) -> list[str]:
    """Return parameters in the form of the program's ``--set``."""
    return [f"{name}={value_text(number_or_text(value))}" for name, value in parameters.items()]


def document_text(document: Table) -> str:
    """Return a document as TOML: single values, then tables and arrays of tables."""
    lines = [f"{_key(name)} = {value_text(value)}" for name, value in document.items() if not isinstance(value, (dict, list))]
    for name, value in document.items():
        tables = value if isinstance(value, list) else [value] if isinstance(value, dict) and value else []
        head = f"[[{_key(name)}]]" if isinstance(value, list) else f"[{_key(name)}]"
        for table in tables:
            lines += ["", head, *(f"{_key(key)} = {value_text(item)}" for key, item in table.items())]
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else value_text(name)
