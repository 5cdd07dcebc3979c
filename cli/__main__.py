"""`python -m cardiac_cosim.cli` is the command `cosim`."""

from .app import supervised_main

if __name__ == "__main__":
    supervised_main()
