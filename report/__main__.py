"""Presents the results in a folder when it is told to on its standard input; see `presentation`, which starts it.

Its arguments are the folder, the process that asks, without which there is nothing to do, and what is to be made.
`begun` says that the fields are there which do not change: what shows only them is drawn already then. `done` says that
all is there; the answer, on the standard output, is a line of JSON. At the end of the input the process ends.
"""

import json
import signal
import sys
import traceback
from pathlib import Path
from typing import Any

from ..orchestrator.supervision import end_with
from .heading import heading
from .presentation import FIGURES, PAGE


def main() -> None:
    """See the module."""
    # Ctrl-C is for the run, which ends this process, or lets it finish.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    folder, parent, parts = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]
    end_with(parent)
    # Imported here: from now on the process ends with the other one.
    from .figures.draw import draw_figures, draw_still
    from .page import prepared, write_page

    # Whatever a library has to say is no answer.
    answers, sys.stdout = sys.stdout, sys.stderr
    still: dict[str, bytes] = {}
    views = None
    for line in sys.stdin:
        answer: dict[str, Any] = {}
        try:
            if line.startswith("begun "):
                if FIGURES in parts:
                    still = draw_still(folder, heading(**json.loads(line.removeprefix("begun "))))
                if PAGE in parts:
                    views = prepared(folder)
                continue
            if FIGURES in parts:
                draw_figures(folder, still)
            if PAGE in parts:
                write_page(folder, views)
        except OSError as error:
            answer = {"place": str(error.filename or folder), "refused": error.strerror or str(error)}
        except Exception:
            answer = {"bug": traceback.format_exc()}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
