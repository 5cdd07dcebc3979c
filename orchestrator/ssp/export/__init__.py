"""A system of FMUs as one package that other tools open (System Structure and Parameterization).

A package is an archive of `SystemStructure.ssd` (who there is and who feeds whom), the FMUs, and a parameter set for
every component that is given values. A system of FMI 2.0 FMUs makes a package of SSP 1.0, where a field is connected
scalar by scalar; one with FMUs of FMI 3.0 a package of SSP 2.0, where it is one connection of two arrays. All
connections are from component to component: connectors of the system itself, which the standard allows, break libcosim
and Ecos.
"""

from .package import write_ssp

__all__ = ["write_ssp"]
