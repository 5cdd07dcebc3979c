"""The implementations (kernels, solvers) of the units: for the summary, for a note if slow, and for a resume.

Kernels, instruction sets and linear solvers round differently. A run that continued with others than it started with
would give the numbers of neither; like a run with other packages it is refused.
"""

import logging
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, ParticipantError, RunError
from ..participants.participant import Implementation, Participant

_LOG = logging.getLogger(__name__)


def implementations(participants: Mapping[str, Participant]) -> dict[str, Implementation]:
    """What each participant says of itself, once it is initialised."""
    found = {}
    for name, participant in participants.items():
        try:
            found[name] = participant.implementation()
        except ParticipantError as error:
            raise RunError(f"unit '{name}' cannot report its implementation (kernels, solvers): {error}") from error
        if found[name].text:
            _LOG.info("%s computes with %s", name, found[name].text)
    return found


def texts(found: Mapping[str, Implementation]) -> dict[str, str]:
    """What each unit computes with, of those that say it."""
    return {name: implementation.text for name, implementation in found.items() if implementation.text}


def fallbacks(found: Iterable[Implementation]) -> list[str]:
    """What is slower than it need be, each sentence once, however many units say it."""
    return list(dict.fromkeys(sentence for implementation in found for sentence in implementation.fallbacks))


def memory(found: Mapping[str, Implementation]) -> dict[str, NDArray[np.str_]]:
    """For a checkpoint."""
    return {name: np.array(text) for name, text in texts(found).items()}


def check(before: Mapping[str, NDArray[np.str_]], found: Mapping[str, Implementation]) -> None:
    """InputError where a unit computes with something else than what the `memory` of an earlier process has."""
    now = texts(found)
    for name in sorted({*before, *now}):
        earlier = str(before[name]) if name in before else "an implementation not reported"
        if earlier != now.get(name, ""):
            raise InputError(
                f"unit '{name}' computed with {earlier} and computes with {now.get(name) or 'one not reported'} here; "
                "results differ between them in their last digits. Continue where the implementation is the same, or "
                "run without --resume to start again"
            )
