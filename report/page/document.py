"""The page as a whole: what the run says of itself, and the programs that show it, in one file."""

import io
import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from ...orchestrator.results.names import PAGE
from ...orchestrator.results.stored_run import StoredRun
from ...orchestrator.results.whole import write_whole
from ..heading import heading_of
from .coupling_curves import constants, coupling_curves
from .headline_table import headline_table
from .heart import heart
from .packed import Packed, compressed
from .panels import figure
from .run_curves import run_curves
from .unit_table import unit_table
from .views import Views, views_of

_OWN = Path(__file__).parent


def write_page(folder: Path, views: Views | None = None) -> Path:
    """Write report.html into a results folder, from what is there; returns the file.

    `views` are those of `prepared`, where that was called when the run began.
    """
    path = folder / PAGE
    run = StoredRun(folder)
    write_whole(path, page(run, views or views_of(run)).encode())
    return path


def prepared(folder: Path | None = None) -> Views | None:
    """Load what every page needs, for there is time while a run goes on; and look at the body of the one in `folder`.

    Of that, the fields that do not change have to be there.
    """
    from plotly import colors  # noqa: F401

    _program()
    _template()
    return None if folder is None else views_of(StoredRun(folder))


def page(run: StoredRun, views: Views | None) -> str:
    """The page of a run, whose results may end anywhere."""
    packed = Packed()
    summary = run.summary
    end_ms = run.end_ms
    series, not_drawn = run_curves(run)
    content = {
        "heart": None if views is None else heart(run, views, packed),
        "curves": figure(series, end_ms),
        "coupling": figure(coupling_curves(run), end_ms),
    }
    request = summary.get("request")
    return str(
        _template().render(
            heading=heading_of(run),
            status=str(summary.get("status", "")),
            message=summary.get("message"),
            end_ms=end_ms,
            summary=summary,
            file=request.get("file") if isinstance(request, dict) else None,
            settings={key: json.dumps(value, ensure_ascii=False) for key, value in run.settings.items()},
            heart=content["heart"],
            has_curves=content["curves"] is not None,
            has_coupling=content["coupling"] is not None,
            constants=constants(run),
            not_drawn=not_drawn,
            headlines=headline_table(run) if end_ms >= 0.0 else [],
            units=unit_table(summary),
            warnings=summary.get("warnings") or [],
            not_modelled=summary.get("not_modelled"),
            versions=summary.get("versions") or {},
            scenario=_yaml(summary["scenario"]) if isinstance(summary.get("scenario"), dict) else None,
            style=_text("page.css"),
            script=_text("page.js"),
            plotly=_program(),
            content=_json(content),
            arrays=packed.text(),
        )
    )


def _json(content: Mapping[str, Any]) -> str:
    """JSON that stands within a page: nothing in it ends the element that it is in."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _yaml(content: Mapping[str, Any]) -> str:
    from ruamel.yaml import YAML

    writer = YAML(typ="safe", pure=True)
    writer.default_flow_style = False
    writer.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    text = io.StringIO()
    writer.dump(dict(content), text)
    return text.getvalue()


def _text(name: str) -> str:
    return (_OWN / name).read_text(encoding="utf-8")


@cache
def _program() -> str:
    """Plotly's program, as it comes with its Python package, compressed."""
    return compressed((files("plotly") / "package_data" / "plotly.min.js").read_bytes())


@cache
def _template() -> Any:
    # Imported here, as all that takes time.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    found = Environment(loader=FileSystemLoader(_OWN / "templates"), autoescape=True, undefined=StrictUndefined)
    found.trim_blocks = found.lstrip_blocks = True
    return found.get_template("report.html")
