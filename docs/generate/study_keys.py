"""The page docs/reference/study_keys.md: every key of a study file, from the model that checks it."""

from pathlib import Path

from cardiac_cosim.studies.study import Study
from key_table import key_tables

PAGE = Path(__file__).parents[1] / "reference" / "study_keys.md"

_HEAD = """\
# Keys of a study

Written by `python docs/generate` from the model that checks every study before it is run (`studies/study.py`).

A study is a YAML file that names a scenario and the settings of it that are tried. `cosim chart` draws error against
cost ([Speed against accuracy](../charts.md)), `cosim stability` maps where the scenario is sound ([Where methods
fail](../stability.md)), and `cosim tune --study` chooses among the study's points ([The cheapest
setting](../tune.md)). In the tables a dot stands for a level of the file, `[]` for an entry of a list, and `<name>`
for a key of the scenario, such as `coupling.step_ms` ([Keys of a scenario](scenario_keys.md)).

"""


def page() -> str:
    """Its text."""
    return _HEAD + key_tables(Study.model_json_schema())
