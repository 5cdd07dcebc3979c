"""Other people's XML: parsed without a document type, so that nothing in it expands, refers or is fetched."""

from typing import Any
from xml.parsers import expat

from lxml import etree

from ..errors import InputError
from ..quoting import shortened

#: Bytes that the parser is given at once. In one piece it would refuse whatever is larger than 10 MB.
_CHUNK = 2**16

#: Elements and attributes together, counted by their signs before a tree of 200 bytes each is made of them. A heart's
#: description of 60 000 variables has a million.
_MOST_MARKS = 8_000_000

_LONGEST = 200


class _Begun(Exception):
    """The root element begins."""


def parse_document(content: bytes) -> Any:
    """The root element of the XML `content`, without comments.

    Raises
    ------
    InputError
        If it has a document type (which entities are declared in), is not well-formed, is nested more than 256 deep, or
        has more elements than memory should hold. The message has the line, not the file.
    """
    _check_prolog(content)
    if content.count(b"<") + content.count(b"=") > _MOST_MARKS:
        raise InputError(f"it has more than {_MOST_MARKS} elements and attributes; leave out what is not needed")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True)
    try:
        for begin in range(0, len(content), _CHUNK):
            parser.feed(content[begin : begin + _CHUNK])
        return parser.close()
    except etree.XMLSyntaxError as error:
        if "Excessive depth" in str(error):
            raise InputError(
                f"it is nested more than 256 deep, in line {error.lineno}; no file of FMI or SSP is"
            ) from None
        raise InputError(f"it is not well-formed XML ({shortened(str(error), _LONGEST)})") from None
    except MemoryError:
        raise InputError("it is too large for the memory; leave out what is not needed") from None


def _check_prolog(content: bytes) -> None:
    """InputError if anything is wrong with what comes before the root element, a document type above all."""
    parser = expat.ParserCreate()

    def refuse(*_: Any) -> None:
        line = parser.CurrentLineNumber
        raise InputError(f"it has a document type (<!DOCTYPE ...>, line {line}), which is not read; remove it")

    def begin(*_: Any) -> None:
        raise _Begun

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = begin
    try:
        parser.Parse(content, True)
    except _Begun:
        return
    # An unknown encoding is a LookupError; one that takes several bytes a character a ValueError.
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise InputError(f"it is not well-formed XML ({shortened(str(error), _LONGEST)})") from None
