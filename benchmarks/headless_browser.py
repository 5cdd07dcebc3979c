"""A browser without a screen and without a network, for whoever looks at pages."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, sync_playwright

#: Chromium by the names that systems give it.
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

#: WebGL by the processor, as machines without a screen have no other.
_ARGUMENTS = ("--enable-unsafe-swiftshader", "--use-gl=angle", "--use-angle=swiftshader")


def program() -> str | None:
    """Where the system's Chromium is; None if it has none."""
    return next((found for found in map(shutil.which, NAMES) if found), None)


@contextmanager
def opened() -> Iterator[Browser]:
    """The browser; FileNotFoundError if the system has none."""
    path = program()
    if path is None:
        raise FileNotFoundError(f"there is no Chromium on this system ({', '.join(NAMES)}); install its package")
    with sync_playwright() as playwright, playwright.chromium.launch(executable_path=path, args=_ARGUMENTS) as browser:
        yield browser
