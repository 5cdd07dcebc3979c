"""report.html: one file that shows a run and opens without a network."""

from .document import prepared, write_page

__all__ = ["prepared", "write_page"]
