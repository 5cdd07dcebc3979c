"""Text in lines that are not too long, however that is measured."""

from collections.abc import Callable

#: Where words that are longer than a line, as keys are, are better broken: after these.
_JOINTS = "_.,:=/-"


def in_lines(text: str, longest: float, length: Callable[[str], float]) -> list[str]:
    """`text` in lines of at most `longest` by `length`, which grows with every letter; longer words are broken."""
    lines, line = [], ""
    for word in text.split():
        while length(word) > longest:
            count = _fitting(word, longest, length)
            lines += [line] * bool(line) + [word[:count]]
            line, word = "", word[count:]
        longer = f"{line} {word}".strip()
        if length(longer) > longest:
            lines.append(line)
            longer = word
        line = longer
    return lines + [line] * bool(line)


# --- inside -----------------------------------------------------------------------------------------------------------


def _fitting(word: str, longest: float, length: Callable[[str], float]) -> int:
    """How many letters of a long word fit, at least one; rather up to a joint than all that fit."""
    count = max(min(int(len(word) * longest / length(word)), len(word) - 1), 1)
    while count > 1 and length(word[:count]) > longest:
        count -= 1
    joint = max(word.rfind(letter, 0, count) for letter in _JOINTS) + 1
    return joint if 2 * joint > count else count
