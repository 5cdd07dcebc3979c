"""Other people's YAML: read as plain values, of bounded size however often an alias repeats a part of it."""

import re
import warnings
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer, MaxDepthExceededError
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from ..quoting import shortened

#: Bytes of a text. A scenario has some thousand.
LARGEST_TEXT = 10_000_000

#: Keys, values and items together, those that an alias repeats counted each time.
_MOST_NODES = 50_000

#: Sections in sections.
_DEEPEST = 20

#: Characters of a number, a date or a truth value; Python refuses to read numbers of more than 4300 digits.
_LONGEST_NUMBER = 1000

#: What is no text: the end of a C string, and halves of a character that no encoding has.
_NO_TEXT = re.compile("[\0\ud800-\udfff]")

_TEXT_TAG = "tag:yaml.org,2002:str"

#: The remedies for what people stumble over, by what the parser complains of.
_REMEDIES = {
    "'\\t'": "indent with spaces, not with tabs",
    "duplicate key": "keep one of the two",
    "mapping values are not allowed": "check the indentation, and that a space follows every colon",
    "could not find expected ':'": "write `key: value`, and check the indentation",
    "expected ',' or": "close the bracket or brace, and separate its items by commas",
    "<block end>": "check the indentation",
    "cannot start any token": "put the text in quotes",
    "undefined alias": "put the text in quotes",
    "another document": "a scenario is one document; remove the line ---",
    "end of stream": "a quote is not closed",
    "constructor for the tag": "put the text in quotes",
}

_LONGEST_PROBLEM = 200


class _Refused(Exception):
    """What is valid YAML, and is not read all the same."""


class _BoundedComposer(Composer):
    """Stops at the first part too many, before the rest is read."""

    def __init__(self, loader: Any = None) -> None:
        super().__init__(loader)
        self.warn_double_anchors = False
        self._nodes = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        self._nodes += 1
        if self._nodes > _MOST_NODES:
            raise _Refused(f"too large: more than {_MOST_NODES} keys, values and items")
        return super().compose_node(parent, index)


class _BoundedConstructor(SafeConstructor):
    """Makes values of the parts only when all of them have been looked at."""

    def construct_document(self, node: Any) -> Any:
        _Look().size(node)
        return super().construct_document(node)


class _Look:
    """Adds up what the aliases stand for."""

    def __init__(self) -> None:
        self._known: dict[Node, tuple[int, int] | None] = {}

    def size(self, node: Node) -> tuple[int, int]:
        """How many nodes there are at `node` and below, and how deep, each alias written out; _Refused if too many."""
        if node in self._known:
            known = self._known[node]
            if known is None:
                raise _Refused(
                    f"not valid YAML{_line(node)}: the anchor '&{shortened(str(node.anchor))}' contains itself"
                )
            return known
        self._known[node] = None
        sizes = [self.size(part) for part in _parts(node)]
        size, depth = 1 + sum(size for size, _ in sizes), 1 + max((depth for _, depth in sizes), default=0)
        if size > _MOST_NODES:
            raise _Refused(f"too large: more than {_MOST_NODES} keys, values and items with all aliases written out")
        if depth > _DEEPEST:
            raise _Refused(f"nested too deeply, more than {_DEEPEST} sections with all aliases written out")
        self._known[node] = size, depth
        return size, depth


def parse_yaml(text: bytes | str) -> Any:
    """The content of `text`; ValueError says what is no YAML, or too much of it, where, and what to do about it."""
    if len(text) > LARGEST_TEXT:
        raise ValueError(
            f"too large: more than {LARGEST_TEXT / 1e6:g} MB, which no scenario has; is it the right file?"
        )
    yaml = YAML(typ="safe", pure=True)
    yaml.Composer, yaml.Constructor, yaml.max_depth = _BoundedComposer, _BoundedConstructor, _DEEPEST
    try:
        with warnings.catch_warnings():
            # Of habits of older versions of YAML: they go to stderr, and name a line of the reader.
            warnings.simplefilter("ignore")
            return yaml.load(text)
    except _Refused as error:
        raise ValueError(str(error)) from None
    except ReaderError as error:
        raise ValueError(f"not a text file (position {error.position}); save it as plain text in UTF-8") from None
    except MaxDepthExceededError as error:
        mark = error.problem_mark
        where = "" if mark is None else f" in line {mark.line + 1}"
        raise ValueError(f"not valid YAML{where}: nested too deeply, more than {_DEEPEST} sections") from None
    except MarkedYAMLError as error:
        raise ValueError(_explained(error)) from None
    # A value that does not fit its tag, or a date that does not exist, ends in whatever the constructor trips over.
    except Exception as error:
        reason = shortened(str(error), _LONGEST_PROBLEM)
        raise ValueError(f"not valid YAML: {reason}; put the text in quotes") from None


def _parts(node: Node) -> list[Node]:
    """The nodes in `node`; _Refused for a scalar that no value is made of."""
    if isinstance(node, MappingNode):
        return [part for pair in node.value for part in pair]
    if isinstance(node, SequenceNode):
        return list(node.value)
    if isinstance(node, ScalarNode):
        if _NO_TEXT.search(node.value):
            raise _Refused(f"not plain text: a character{_line(node)} is \\0 or half of a surrogate pair; remove it")
        if str(node.tag) != _TEXT_TAG and len(node.value) > _LONGEST_NUMBER:
            digits = sum(map(str.isalnum, node.value))
            raise _Refused(f"not valid YAML{_line(node)}: a number of {digits} digits; round it")
    return []


def _line(node: Node) -> str:
    return "" if node.start_mark is None else f" in line {node.start_mark.line + 1}"


def _explained(error: MarkedYAMLError) -> str:
    mark = error.problem_mark or error.context_mark
    line = "" if mark is None else f" in line {mark.line + 1}"
    problem = " ".join(str(error.problem or error.context).split())
    if "duplicate key" in problem:
        problem = problem.partition(" with value")[0]
    remedy = next((f"; {remedy}" for sign, remedy in _REMEDIES.items() if sign in problem), "")
    return f"not valid YAML{line}: {shortened(problem, _LONGEST_PROBLEM)}{remedy}"
