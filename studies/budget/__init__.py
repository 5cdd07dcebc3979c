"""Error budgets: what each source of numerical error adds to the numbers that a run is asked for."""

from .compute import error_budget
from .sentences import sentences
from .written import write_budget

__all__ = ["error_budget", "sentences", "write_budget"]
