"""A report in a browser, as a test looks at it."""

import re
import time
from dataclasses import dataclass, field

from playwright.sync_api import Page

#: Where much else runs, everything takes longer.
_PATIENCE_S = 120.0


@dataclass
class Look:
    """A page that is open, and what it should not have done."""

    page: Page
    complaints: list[str] = field(default_factory=list)

    @property
    def time_ms(self) -> float:
        """What the page says the time is."""
        found = re.fullmatch(r"([\d.]+) ms", self.page.inner_text("#now"))
        assert found is not None
        return float(found[1])

    @property
    def cursor_ms(self) -> float:
        """Where the cursor of the curves is."""
        return float(self.page.evaluate("document.getElementById('curves').layout.shapes[0].x0"))

    def trace(self, number: int, *names: str) -> list[list[float]]:
        """What Plotly draws, by the names of the trace's arrays."""
        arrays = ", ".join(f"Array.from(trace.{name})" for name in names)
        content = f"(() => {{ const trace = document.getElementById('heart').data[{number}]; return [{arrays}] }})()"
        return list(self.page.evaluate(content))

    def go_to(self, frame: int) -> None:
        """Move the slider to a frame, and wait until the body has followed."""
        before = self.trace(0, "x", "y", "z", "intensity")
        self.page.fill("#time", str(frame))
        self.settle()
        assert self.trace(0, "x", "y", "z", "intensity") != before

    def settle(self) -> None:
        """Wait until what was asked for is drawn."""
        self.until("document.body.dataset.drawing !== 'yes'")

    def until(self, condition: str) -> None:
        """Wait for a condition in JavaScript; the page's own rules forbid the browser to try it by itself."""
        until = time.monotonic() + _PATIENCE_S
        while not self.page.evaluate(condition):
            assert time.monotonic() < until, condition
            self.page.wait_for_timeout(20)
