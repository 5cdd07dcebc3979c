"""System packages (SSP 1.0 and 2.0) as scenarios."""

from .package import open_package

__all__ = ["open_package"]
