"""The reason why an experiment cannot count as verified."""


class Unverified(Exception):
    """An experiment failed as a whole, or its results are none; the message is a sentence for a person."""
