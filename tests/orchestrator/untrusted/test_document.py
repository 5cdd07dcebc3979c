"""A stranger's XML could expand to gigabytes, read the person's files, or call other machines."""

import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.untrusted.document import parse_document

LAUGHS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 30))


def refused(content: bytes) -> str:
    with pytest.raises(InputError) as caught:
        parse_document(content)
    message = str(caught.value)
    assert len(message) < 400
    assert "\n" not in message
    return message


@pytest.mark.parametrize(
    "prolog",
    [
        "<!DOCTYPE a>",
        f'<!DOCTYPE a [<!ENTITY l0 "ha">{LAUGHS}]>',
        f'<!-- nothing to see -->\n<?x y?>\n<!DOCTYPE a [<!ENTITY l0 "ha">{LAUGHS}]>',
        '<!DOCTYPE a [<!ENTITY l29 SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE a SYSTEM "http://127.0.0.1:9/a.dtd">',
        '<!DOCTYPE a [<!ENTITY % p SYSTEM "http://127.0.0.1:9/a.dtd"> %p;]>',
        '<!DOCTYPE a [<!ATTLIST a b CDATA "default">]>',
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-8-sig", "latin-1"])
def test_no_document_type_is_read(prolog: str, encoding: str) -> None:
    """Entities could expand (billion laughs), or bring the content of /etc/passwd into a message."""
    head = f'<?xml version="1.0" encoding="{encoding.removesuffix("-sig")}"?>'
    content = f'{head}{prolog}<a b="&l29;">&l29;</a>'.encode(encoding)
    assert "document type" in refused(content)


def test_encodings_that_hide_the_document_type_are_refused() -> None:
    """A parser that knows more encodings than the check before it could read what the check did not see."""
    text = '<?xml version="1.0" encoding="{}"?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'
    for encoding in (
        "utf-7",
        "utf-32",
        "utf-16-le",
        "utf-16-be",
        "cp037",
        "cp500",
        "iso2022_jp",
        "shift_jis",
        "gb18030",
        "cp1252",
    ):
        refused(text.format(encoding).encode(encoding))


def test_sound_documents_are_read() -> None:
    """A model description of a whole heart, in any encoding, could be refused."""
    variables = "".join(f'<ScalarVariable name="stretch[{i}]" valueReference="{i}"/>' for i in range(120_000))
    root = parse_document(f"<!-- c --><fmi>{variables}<!-- c --></fmi>".encode("utf-16"))
    assert len(root) == 120_000
    assert root[-1].get("name") == "stretch[119999]"
    assert parse_document('<?xml version="1.0" encoding="windows-1252"?><a b="°"/>'.encode("cp1252")).get("b") == "°"
    assert parse_document(b"<a>&lt;&#176;<![CDATA[<!DOCTYPE]]></a>").text == "<°<!DOCTYPE"
    assert parse_document(f'<a b="{"x" * 9_000_000}"/>'.encode()).get("b") == "x" * 9_000_000


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\0\xff",
        b"hello",
        b"<a>",
        b"<a></b>",
        b"<a b='1' b='2'/>",
        b"<a/><a/>",
        b"<a>&undefined;</a>",
        b"<a x:b='1'/>",
        b"<a>\xff</a>",
        b"<a " + b"x" * 100_000 + b"></b>",
        b"<?xml version='1.0' encoding='nonsense'?><a/>",
        b"<?xml version='1.0' encoding='rot13'?><a/>",
        b"<?xml version='1.0' encoding='utf-16'?><a/>",
    ],
)
def test_what_is_no_xml_is_one_short_message(content: bytes) -> None:
    """Damaged XML could end in a traceback, or in a message of megabytes."""
    assert "not well-formed XML" in refused(content)


def test_documents_are_bounded_in_depth() -> None:
    """What walks through a document, level by level, could end in a traceback."""
    for content in (b"<a>" * 100_000, b"\n" + b"<a>" * 1000 + b"</a>" * 1000):
        assert "nested more than 256 deep, in line" in refused(content)
    assert parse_document(b"<a>" * 200 + b"</a>" * 200).tag == "a"


def test_trees_that_memory_should_not_hold_are_refused() -> None:
    """Elements of four bytes each could take fifty times that in memory."""
    assert "more than 8000000" in refused(b"<a>" + b"<b/>" * 8_000_001 + b"</a>")
