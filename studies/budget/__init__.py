"""Error budgets: what each source of numerical error adds to the numbers that a run is asked for."""

from .budget_files import write_budget
from .compute import error_budget
from .sentences import sentences

__all__ = ["error_budget", "sentences", "write_budget"]
