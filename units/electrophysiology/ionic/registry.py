"""The ionic models by name. A new one is a file in this folder and a line in `IONIC_MODELS`."""

from dataclasses import dataclass

from ...variable import parameter
from .aliev_panfilov import AlievPanfilov
from .mitchell_schaeffer import MitchellSchaeffer
from .model import IonicModel

IONIC_MODELS: dict[str, type[IonicModel]] = {
    AlievPanfilov.name: AlievPanfilov,
    MitchellSchaeffer.name: MitchellSchaeffer,
}


@dataclass(frozen=True)
class IonicChoice:
    """Which of them the cells have."""

    ionic_model: str = parameter(AlievPanfilov.name, "1", "ionic model of the cells", choices=tuple(IONIC_MODELS))
