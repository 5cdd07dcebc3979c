"""XML written as text: a field of thousands of scalars makes a tree of many megabytes otherwise."""

from xml.sax.saxutils import quoteattr


def tag(element: str, /, end: bool = False, **attributes: str) -> str:
    """`element` with its `attributes`; with `end` it is closed, and empty."""
    text = "".join(f" {key}={quoteattr(value)}" for key, value in attributes.items())
    return f"<{element}{text}{'/' if end else ''}>"
