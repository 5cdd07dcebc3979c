"""A scenario as a system of connected FMUs, for tools that have no scenarios: libcosim, containers, packages (`ssp`)."""
