"""The page docs/reference/scenario_keys.md: every key of a scenario file, from the model that checks it."""

from pathlib import Path

from cardiac_cosim.orchestrator.scenario.model import Scenario
from key_table import key_tables

PAGE = Path(__file__).parents[1] / "reference" / "scenario_keys.md"

_HEAD = """\
# Keys of a scenario

Written by `python docs/generate` from the model that checks every scenario before it is run
(`orchestrator/scenario/model.py`).

A scenario is a YAML file. In the tables a dot stands for a level of the file: `coupling.step_ms` is the key `step_ms`
below `coupling`, and so it is written after `--set` (`--set coupling.step_ms=5`). `<name>` is a name that you choose,
such as that of a unit or of a probe, and `[]` an entry of a list. A key that is not listed here is refused, with the
nearest one that is. `cosim show FILE` says what a scenario would build, exchange and solve. The parameters of the
units, below `units.<name>.parameters`, are listed in [The units and their variables](../units.md).

"""


def page() -> str:
    """Its text."""
    return _HEAD + key_tables(Scenario.model_json_schema())
