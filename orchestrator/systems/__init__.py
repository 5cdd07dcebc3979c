"""A scenario as a system of connected FMUs, for tools without scenarios: libcosim, containers, packages (`ssp`)."""
