"""The measurements as a figure: the time of a heartbeat and of its parts over the number of unknowns."""

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

from .tables import factorisations, of_kind


def draw(record: dict[str, Any], path: Path) -> None:
    """Draw one `record` to `path`."""
    beats = [one for one in of_kind(record["measured"], "heartbeat") if one["participants"] == "native"]
    alone = of_kind(record["measured"], "electrophysiology")
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
    unknowns = [one["unknowns"] for one in beats]
    lines = {
        "whole loop": [one["loop_s"] for one in beats],
        "mechanics": [one["units_s"]["mechanics"] for one in beats],
        "electrophysiology": [one["units_s"]["electrophysiology"] for one in beats],
        "master": [one["master_s"] for one in beats],
    }
    for (name, seconds), marker in zip(lines.items(), "osD^", strict=True):
        left.loglog(unknowns, seconds, marker=marker, label=name)
    for one in beats:
        text = f"{one['size_mm']:g} mm\n{factorisations(one):.0f} factorisations"
        place = {"xytext": (-7.0, 3.0), "textcoords": "offset points", "ha": "right", "fontsize": 8}
        left.annotate(text, (one["unknowns"], one["loop_s"]), **place)
    left.axhline(0.32, color="0.6", linestyle=":", linewidth=1.0)
    left.annotate("real time", (unknowns[-1], 0.32), (0.0, 3.0), textcoords="offset points", ha="right", fontsize=8)
    left.set(xlabel="unknowns of the mechanics", ylabel="seconds for a heartbeat of 320 ms", title="Whole heartbeat")
    left.set_xlim(unknowns[0] / 5.0, unknowns[-1] * 1.5)
    left.margins(y=0.12)
    left.legend(fontsize=8, loc="lower right")
    elements = [one["elements"] for one in alone]
    right.loglog(elements, [one["ms_per_step"] for one in alone], "D-", label="a step of 1 ms")
    right.loglog(elements, [1e3 * one["setup_s"] for one in alone], "s-", label="set-up")
    right.loglog(
        elements,
        [alone[0]["ms_per_step"] * (count / elements[0]) ** 1.1 for count in elements],
        "k:",
        linewidth=1.0,
        label="slope 1.1",
    )
    right.set(xlabel="tetrahedra", ylabel="ms", title="Electrophysiology alone")
    right.legend(fontsize=8, loc="upper left")
    for axes in (left, right):
        axes.grid(which="major", alpha=0.3)
    figure.suptitle(f"{record['machine']['processor']}, {record['date']}", fontsize=9)
    figure.savefig(path, dpi=120)
    plt.close(figure)
