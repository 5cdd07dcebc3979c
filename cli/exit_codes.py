"""The exit codes of the command; 0 is done, and 1 is left for what should not happen, an exception nobody expected."""

INPUT_WRONG = 2
RUN_FAILED = 3
#: Added to the number of the signal that stopped a run, as shells do: 130 after Ctrl-C.
INTERRUPTED = 128
