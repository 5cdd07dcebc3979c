"""If this failed, an installed copy would lack a part that the checkout has."""

import tomllib
from importlib.metadata import version
from pathlib import Path

_ROOT = Path(__file__).parent.parent
_FLOORS = ("units", "fmus", "orchestrator", "studies", "report", "cli")
_PROJECT = tomllib.loads((_ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_every_package_is_installed() -> None:
    found = {
        "cardiac_cosim." + ".".join(path.parent.relative_to(_ROOT).parts)
        for floor in _FLOORS
        for path in (_ROOT / floor).rglob("__init__.py")
    }
    assert found == set(_PROJECT["tool"]["setuptools"]["packages"])


def test_static_tools_see_every_floor() -> None:
    links = {path.name: path.resolve() for path in (_ROOT / "typings" / "cardiac_cosim").iterdir()}
    assert links == {floor: _ROOT / floor for floor in _FLOORS}


def test_version_is_the_same_everywhere() -> None:
    assert version("cardiac-cosim") == _PROJECT["project"]["version"]
    assert f"version: {_PROJECT['project']['version']}\n" in (_ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"## [{_PROJECT['project']['version']}]" in (_ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
