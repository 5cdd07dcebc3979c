"""The names of quantities for a person, with their units of measure."""

#: Units of measure as names end in them, and as they are written.
UNITS = {"ms": "ms", "mV": "mV", "mm": "mm", "ml": "ml", "kPa": "kPa", "deg": "°", "s": "s"}

#: What the names of quantities leave out.
_SPOKEN = {
    "potential": "transmembrane potential",
    "active stress mean": "mean active stress",
    "lv volume": "volume of the left ventricle",
    "rv volume": "volume of the right ventricle",
    "lv pressure": "pressure in the left ventricle",
    "rv pressure": "pressure in the right ventricle",
    "stretch": "fibre stretch",
}


def split(name: str) -> tuple[str, str]:
    """A name as what it is of and its unit of measure as written, empty where it names none."""
    stem, _, last = name.rpartition("_")
    return (stem, UNITS[last]) if stem and last in UNITS else (name, "")


def spoken(name: str) -> str:
    """What a name is of, for a person: `transmembrane potential at the apex` of `potential_apex_mV`."""
    stem = split(name)[0]
    unit, _, own = stem.rpartition(".")
    if own.startswith("potential_"):
        text = f"transmembrane potential at {own.removeprefix('potential_')}"
    else:
        text = own.replace("_", " ")
        text = _SPOKEN.get(text, text)
    return f"{text} of {unit}" if unit else text


def with_unit(text: str, unit: str) -> str:
    """`text (unit)`, as an axis is labelled; without a unit what is known of that."""
    return f"{text} ({unit})" if unit else f"{text} (dimensionless)"
