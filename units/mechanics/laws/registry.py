"""The passive materials by name. A new law is a file of its own and a line here."""

from dataclasses import dataclass

from ...variable import parameter
from .guccione import Guccione
from .holzapfel_fiber import HolzapfelFiber
from .law import Law
from .neo_hooke import NeoHooke

#: Materials, and the laws that add up to each.
MATERIALS: dict[str, tuple[type[Law], ...]] = {
    "neo_hooke_with_fibers": (NeoHooke, HolzapfelFiber),
    "neo_hooke": (NeoHooke,),
    "guccione": (Guccione,),
}

#: Every law once: the groups of parameters of a unit that has a material.
LAWS: tuple[type[Law], ...] = tuple(dict.fromkeys(law for laws in MATERIALS.values() for law in laws))


@dataclass(frozen=True)
class Material:
    """Which laws the tissue follows."""

    material: str = parameter(
        "neo_hooke_with_fibers",
        "1",
        "passive material, a sum of laws; parameters of laws that are not part of it have no effect",
        choices=tuple(MATERIALS),
    )

    @property
    def laws(self) -> tuple[type[Law], ...]:
        """The laws that add up to it."""
        return MATERIALS[self.material]
