"""Reference experiments: what stands in files of experiments, or what a result by itself is the result of."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from math import isfinite
from typing import Any

from lxml import etree

from ..errors import InputError
from ..quoting import quoted, shortened
from ..untrusted.document import parse_document
from .manifest import EXPERIMENT_TYPES, Manifest, Related
from .reference_files import MANIFEST_PATH, ReferenceFiles
from .schema_check import check_experiments

#: The relative tolerance where neither the experiment nor the FMU's default experiment has one.
DEFAULT_TOLERANCE = 1e-6

_TABLE, _PARAMETERS = "text/csv", "application/x-ssp-parameter-set"

#: The role of experiments that vary what is given, and have no results to be compared with.
_UNCERTAINTY = "experiment/uncertainty-analysis"


@dataclass(frozen=True)
class Experiment:
    """An experiment: times in s, None where they are left to the results, and the names of its files in the FMU.

    `is_alone` tells a result that no experiment refers to: that of the FMU's default experiment.
    """

    name: str
    start_s: float
    stop_s: float | None
    step_s: float | None
    tolerance: float
    parameters: str | None = None
    stimuli: str | None = None
    references: str | None = None
    is_alone: bool = False


@dataclass(frozen=True)
class Defaults:
    """The FMU's default experiment (FMI 2.0.4, section 2.2.5; FMI 3.0, section 2.4.5); None where it says nothing."""

    start_s: float | None
    stop_s: float | None
    step_s: float | None
    tolerance: float | None

    @classmethod
    def of(cls, declared: Any) -> "Defaults":
        """Of FMPy's DefaultExperiment, which may be None; InputError for what is no number."""
        attributes = ("startTime", "stopTime", "stepSize", "tolerance")
        given = [None if declared is None else getattr(declared, name, None) for name in attributes]
        what = "modelDescription.xml: the DefaultExperiment"
        numbers = [_number(value, name, what) for value, name in zip(given, attributes, strict=True)]
        return cls(*numbers)


def read_experiments(
    files: ReferenceFiles, manifest: Manifest, defaults: Defaults, tell: Callable[[str], None]
) -> list[Experiment]:
    """All experiments that `manifest` tells of.

    Results that no experiment refers to are those of the default experiment, where there are no experiments at all;
    what is left out is told to `tell`. InputError where nothing is left, and for what is damaged.
    """
    reader = _Reader(files, defaults)
    found = [reader.experiment(element, MANIFEST_PATH) for element in reader.checked_inside(manifest)]
    for related in manifest.related:
        if related.main_role == "experiment":
            found += reader.file(related, tell)
    results = [related for related in manifest.related if related.main_role == "result"]
    if not found:
        found = [reader.alone(related) for related in results if _is_table(related, tell)]
    else:
        known = {item.references for item in found}
        for related in results:
            if files.refer(related.source, MANIFEST_PATH, "a result") not in known:
                tell(f"the result {shortened(related.source)} belongs to none of the experiments; it is not compared")
    if not any(item.references for item in found):
        raise InputError(
            f"{MANIFEST_PATH}: it names no experiment with results that can be read, so the FMU cannot be "
            f"verified; results are tables ({_TABLE}), and experiments are of the type {EXPERIMENT_TYPES[0]}"
        )
    return found


class _Reader:
    def __init__(self, files: ReferenceFiles, defaults: Defaults) -> None:
        self._files, self._defaults = files, defaults

    def checked_inside(self, manifest: Manifest) -> tuple[Any, ...]:
        """The experiments that stand in the manifest, as in the standard's first draft."""
        if manifest.experiments:
            root = etree.Element("Experiments", name="manifest")
            root.extend(deepcopy(element) for element in manifest.experiments)
            check_experiments(root, MANIFEST_PATH)
        return manifest.experiments

    def file(self, related: Related, tell: Callable[[str], None]) -> list[Experiment]:
        """The experiments in a file of them."""
        where = shortened(related.source)
        if related.type not in EXPERIMENT_TYPES:
            tell(f"the experiment {where} is of the type {shortened(related.type)}, which is not read; it is left out")
            return []
        if related.role == _UNCERTAINTY:
            tell(f"the experiment {where} is for the analysis of uncertainty, not for verification; it is left out")
            return []
        name = self._files.refer(related.source, MANIFEST_PATH, "a file of experiments")
        try:
            root = parse_document(self._files.read(name))
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
        if root.tag != "Experiments":
            raise InputError(
                f"{name}: its root is {shortened(str(root.tag))}, but a file of experiments has the root Experiments "
                "without a namespace; other formats are not read"
            )
        check_experiments(root, name)
        return [self.experiment(element, name) for element in root.iterfind("Experiment")]

    def experiment(self, element: Any, origin: str) -> Experiment:
        """The experiment that an `element` in the file `origin` has; what it leaves out is that of the FMU's own."""
        title = shortened(element.get("name"))
        what = f"{origin}: the experiment '{title}'"
        attributes = ("startTime", "stopTime", "stepSize", "tolerance")
        start, stop, step, tolerance = (_number(element.get(name), name, what) for name in attributes)
        return self._made(
            what,
            name=title,
            start=start,
            stop=stop,
            step=step,
            tolerance=tolerance,
            parameters=self._source(element, "Parameters", _PARAMETERS, origin, title),
            stimuli=self._source(element, "Stimuli", _TABLE, origin, title),
            references=self._source(element, "References", _TABLE, origin, title),
        )

    def alone(self, related: Related) -> Experiment:
        """The default experiment, whose result this is."""
        name = self._files.refer(related.source, MANIFEST_PATH, "a result")
        title = f"default, {shortened(related.source)}"
        return self._made(MANIFEST_PATH, name=title, references=name, is_alone=True)

    def _made(
        self,
        what: str,
        name: str,
        start: float | None = None,
        stop: float | None = None,
        step: float | None = None,
        tolerance: float | None = None,
        **rest: Any,
    ) -> Experiment:
        own = self._defaults
        begin, end = _first(start, own.start_s, 0.0), _first(stop, own.stop_s)
        size, allowed = _first(step, own.step_s), _first(tolerance, own.tolerance, DEFAULT_TOLERANCE)
        if begin is None or allowed is None:
            raise TypeError("both have a default")
        if end is not None and not end > begin:
            raise InputError(f"{what}: it ends at {end:g} s, not after its start at {begin:g} s; correct stopTime")
        if size is not None and not size > 0.0:
            raise InputError(f"{what}: its step is {size:g} s; a stepSize is above 0")
        if not allowed >= 0.0:
            raise InputError(f"{what}: its tolerance is {allowed:g}; a tolerance is at least 0")
        return Experiment(name, begin, end, size, allowed, **rest)

    def _source(self, element: Any, kind: str, type_: str, origin: str, title: str) -> str | None:
        child = element.find(kind)
        if child is None:
            return None
        what = f"the {kind} of the experiment '{title}'"
        if child.get("type", type_) != type_:
            raise InputError(
                f"{origin}: {what} are of the type {shortened(child.get('type'))}, which is not read; give them as "
                f"{type_}"
            )
        return self._files.refer(child.get("source"), origin, what)


def _is_table(related: Related, tell: Callable[[str], None]) -> bool:
    if related.type == _TABLE:
        return True
    tell(
        f"the result {shortened(related.source)} is of the type {shortened(related.type)}, which is not read; it is "
        "not compared"
    )
    return False


def _number(value: Any, name: str, what: str) -> float | None:
    if value is None:
        return None
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not isfinite(number):
        raise InputError(f"{what}: {name} is {quoted(value)}; expected a finite number")
    return number


def _first(*values: float | None) -> float | None:
    return next((value for value in values if value is not None), None)
