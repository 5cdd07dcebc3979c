"""How large the report of a run is, how long it takes to write, and how soon it shows the tissue.

    python -m benchmarks.report_page results/baseline [--picture docs/images/report.png]

The first frame is measured in Chromium that draws by the processor, from the request on; with --picture a screenshot of
the page in the middle of contraction is kept.
"""

import argparse
import time
from pathlib import Path

from cardiac_cosim.report.page import prepared, write_page

from .headless_browser import opened

_WIDTH, _HEIGHT = 1280, 800

#: Part of the run at which the picture is taken.
_PICTURED = 0.3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    views = prepared(options.folder)
    begun = time.perf_counter()
    path = write_page(options.folder, views)
    print(f"written in {time.perf_counter() - begun:.2f} s")
    print(f"size {path.stat().st_size / 1e6:.2f} MB")
    with opened() as browser:
        tab = browser.new_page(viewport={"width": _WIDTH, "height": _HEIGHT}, device_scale_factor=1)
        session = tab.context.new_cdp_session(tab)
        session.send("Performance.enable")
        tab.goto(path.absolute().as_uri())
        tab.wait_for_selector("body[data-ready]", timeout=120_000)
        marks = tab.evaluate("performance.getEntriesByType('mark').map((mark) => [mark.name, mark.startTime])")
        for name, at_ms in marks:
            print(f"{name} after {at_ms / 1000.0:.2f} s")
        # What it takes where nothing else runs.
        found = {metric["name"]: metric["value"] for metric in session.send("Performance.getMetrics")["metrics"]}
        print(f"processor time of the page's thread until all is shown {found['ThreadTime']:.2f} s")
        if options.picture:
            last = int(tab.get_attribute("#time", "max") or 0)
            tab.select_option("#cut", "0")
            tab.fill("#time", str(round(_PICTURED * last)))
            tab.wait_for_timeout(2000)
            tab.screenshot(path=options.picture)


if __name__ == "__main__":
    main()
