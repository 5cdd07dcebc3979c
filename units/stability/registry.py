"""The theories by name. A new one is a file in this folder and a line here."""

from .active_stress_step import ActiveStressStep
from .explicit_diffusion import ExplicitDiffusion
from .feedback import Feedback
from .loop_gain import LoopGain
from .pinned_front import PinnedFront
from .reaction_step import ReactionStep
from .resting_tissue import RestingTissue
from .theory import Theory
from .two_masses import TwoMasses

_ALL: tuple[Theory, ...] = (
    LoopGain(),
    TwoMasses(),
    Feedback(),
    ReactionStep(),
    ActiveStressStep(),
    ExplicitDiffusion(),
    PinnedFront(),
    RestingTissue(),
)

THEORIES: dict[str, Theory] = {theory.name: theory for theory in _ALL}
