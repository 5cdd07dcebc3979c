"""Draws the figures of the results folder that is its argument, when it is told to on its standard input (`drawing`).

`begun` says that the fields are there which do not change: what shows only them is drawn already then. `done` says that
all is there; the answer, on the standard output, is a line of JSON. At the end of the input the process ends.
"""

import json
import signal
import sys
import traceback
from pathlib import Path
from typing import Any

from ...supervision import end_with


def main() -> None:
    """See the module. The arguments are the folder and the process that asks, without which there is nothing to do."""
    # Ctrl-C is for the run, which ends this process, or lets it finish.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    folder, parent = Path(sys.argv[1]), int(sys.argv[2])
    end_with(parent)
    # Imported here: from now on the process ends with the other one.
    from .draw import draw_figures, draw_still

    # Whatever a library has to say is no answer.
    answers, sys.stdout = sys.stdout, sys.stderr
    still: dict[str, bytes] = {}
    for line in sys.stdin:
        answer: dict[str, Any] = {}
        try:
            if line == "begun\n":
                still = draw_still(folder)
                continue
            draw_figures(folder, still)
        except OSError as error:
            answer = {"place": str(error.filename or folder / "figures"), "refused": error.strerror or str(error)}
        except Exception:
            answer = {"bug": traceback.format_exc()}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
