"""The cheapest setting of a scenario that keeps given tolerances."""

from .report import summary
from .result import Tuning
from .tolerances import parsed_tolerances
from .tuning import tune_scenario, tune_study
from .tuning_files import write_tuning

__all__ = ["Tuning", "parsed_tolerances", "summary", "tune_scenario", "tune_study", "write_tuning"]
