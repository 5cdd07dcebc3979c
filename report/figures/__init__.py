"""The figures of a run, drawn from what it left in its results folder."""
