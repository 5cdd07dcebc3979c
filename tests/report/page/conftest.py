"""Runs of all kinds, small and short, and a browser without a network that opens their reports."""

from collections.abc import Callable, Iterator
from pathlib import Path

import headless_browser
import pytest
from cardiac_cosim.orchestrator.errors import RunError
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.orchestrator.simulation import simulate
from cardiac_cosim.report.page import write_page
from playwright.sync_api import Browser, ConsoleMessage
from report_kinds import HEART, SHORT
from report_look import Look

_SCENARIOS = Path(__file__).parents[3] / "scenarios"


@pytest.fixture(scope="session")
def run_of(tmp_path_factory: pytest.TempPathFactory, small_heart_file: Path) -> Callable[[str], StoredRun]:
    """Runs a scene of a kind when it is first asked for, and writes its report."""
    found: dict[str, StoredRun] = {}

    def run(kind: str) -> StoredRun:
        if kind not in found:
            folder = tmp_path_factory.mktemp(kind)
            file, settings = folder / "heart.yaml", {}
            if kind == "heart":
                file.write_text(HEART.replace("MESH", str(small_heart_file)), encoding="utf-8")
            else:
                name, settings = SHORT[kind]
                file = _SCENARIOS / f"{name}.yaml"
            try:
                simulate(file, {"run.participants": "native", **settings}, folder / "out")
            except RunError:
                assert kind == "failed"
            found[kind] = StoredRun(folder / "out")
            write_page(found[kind].folder)
        return found[kind]

    return run


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    if headless_browser.program() is None:
        pytest.skip(
            "there is no Chromium on this system, in which the page would be looked at; `./setup.sh test` installs it "
            "where Debian's package `chromium` exists"
        )
    with headless_browser.opened() as found:
        yield found


@pytest.fixture
def look(browser: Browser) -> Iterator[Callable[..., Look]]:
    """Opens a file without a network, and in the end makes sure that nothing went wrong."""
    looks: list[Look] = []

    def opened(path: Path, width: int = 1280, height: int = 900) -> Look:
        context = browser.new_context(viewport={"width": width, "height": height}, offline=True)
        # Where much else runs, everything takes longer.
        context.set_default_timeout(120_000)
        found = Look(context.new_page())

        def complain(message: ConsoleMessage) -> None:
            if message.type == "error":
                found.complaints.append(message.text)

        found.page.on("console", complain)
        found.page.on("pageerror", lambda error: found.complaints.append(str(error)))
        asked: list[str] = []
        found.page.on("request", lambda request: asked.append(request.url))
        found.page.goto(path.as_uri())
        found.page.wait_for_selector("body[data-ready]", state="attached")
        found.complaints += [url for url in asked if url != path.as_uri() and not url.startswith(("data:", "blob:"))]
        looks.append(found)
        return found

    yield opened
    for each in looks:
        each.page.context.close()
        assert each.complaints == []
