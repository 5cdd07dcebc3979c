"""Keys of a study in words, as they stand at an axis: `coupling.step_ms` is the step (ms)."""

import re

#: Units of measure as names of settings end in them, and as people write them.
_UNITS = {"deg": "°", "mm2": "mm²"} | {
    unit: unit for unit in ("ms", "s", "mV", "mm", "m", "ml", "kg", "N", "kPa", "MPa", "percent")
}

_UNIT = "|".join(_UNITS)
_NAME = re.compile(rf"(?P<name>.+?)(?:_(?P<unit>{_UNIT}))?(?:_per_(?P<per>{_UNIT}))?")

_SYMBOL = re.compile(r"[A-Za-z]_\w{1,2}")


def axis_words(key: str) -> str:
    """The last part of a key with its unit of measure: `coupling.step_ms` becomes `step (ms)`."""
    last = key.rpartition(".")[2] or key
    found = _NAME.fullmatch(last)
    if found is None:
        return last
    name, unit, per = found["name"], found["unit"], found["per"]
    measured = _UNITS[unit] if unit else "1" if per else ""
    if per:
        measured += f"/{_UNITS[per]}"
    # A symbol with an index, k_c, stays one.
    words = name if _SYMBOL.fullmatch(name) else name.replace("_", " ")
    return words + (f" ({measured})" if measured else "")


def pair_words(x_key: str, y_key: str) -> tuple[str, str]:
    """The same of two keys; whole keys where their last parts do not tell them apart."""
    x, y = axis_words(x_key), axis_words(y_key)
    return (x_key, y_key) if x == y else (x, y)
