"""A small tree of XML elements that know their line, for messages."""

import xml.parsers.expat
from collections.abc import Iterator
from dataclasses import dataclass, field

from crowd.errors import ScenarioError, describe


@dataclass
class Element:
    """One element.

    Attributes
    ----------
    name : str
        Without namespace.
    namespace : str
        Empty when there is none.
    line : int
        Line of the start tag, from 1.
    text : str
        Text directly inside, without blanks around it.
    children : list of Element
    """

    name: str
    namespace: str
    line: int
    text: str = ""
    children: list["Element"] = field(default_factory=list)

    def child(self, name: str) -> "Element | None":
        """First child of a name."""
        return next((child for child in self.children if child.name == name), None)

    def all(self, name: str) -> Iterator["Element"]:
        """Children of a name."""
        return (child for child in self.children if child.name == name)


def parse_xml(data: bytes, label: str) -> Element:
    """Parse a whole document.

    Parameters
    ----------
    data : bytes
    label : str
        File name for messages.

    Returns
    -------
    Element
        The root.

    Raises
    ------
    ScenarioError
        The text is not well-formed, or declares a document type (entities could make it arbitrarily large).
    """
    parser = xml.parsers.expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    open_elements: list[Element] = []
    roots: list[Element] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        namespace, _, local = name.rpartition(" ")
        element = Element(local, namespace, parser.CurrentLineNumber)
        (open_elements[-1].children if open_elements else roots).append(element)
        open_elements.append(element)

    def end(name: str) -> None:
        element = open_elements.pop()
        element.text = element.text.strip()

    def text(piece: str) -> None:
        if open_elements:
            open_elements[-1].text += piece

    def refuse_doctype(*_: object) -> None:
        line = parser.CurrentLineNumber
        raise ScenarioError(describe(f"{label}: line {line}", "document type is not accepted", "<!DOCTYPE"))

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = refuse_doctype
    try:
        parser.Parse(data, True)
    except xml.parsers.expat.ExpatError as error:
        reason = xml.parsers.expat.ErrorString(error.code)
        place = f"{label}: line {error.lineno}, column {error.offset + 1}"
        raise ScenarioError(describe(place, f"is not well-formed XML: {reason}")) from error
    return roots[0]
