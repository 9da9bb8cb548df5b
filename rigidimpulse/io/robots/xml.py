"""XML files of robots, read without expanding entities (an entity can expand without end), and the files they name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.named_files import named_file


def read_xml(path: Path) -> Any:
    """Return the root element of an XML file.

    Raises:
        SceneError: no such file, the package defusedxml is missing, or the file is broken or has entities of its own.

    """
    where = repr(path.name)
    if not path.is_file():
        raise SceneError(f"there is no such file (looked for {path.absolute()})", "check the path", where)
    try:
        from defusedxml import DefusedXmlException
        from defusedxml.ElementTree import ParseError, parse
    except ImportError as error:
        raise SceneError(f"robot files need the package defusedxml ({error})", "pip install 'rigidimpulse[robot]'", where) from None
    try:
        return parse(str(path)).getroot()
    except ParseError as error:
        raise SceneError(f"it is no XML ({error})", "correct it at that line", where) from None
    except (DefusedXmlException, UnicodeDecodeError) as error:
        raise SceneError(f"its XML is refused ({error})", "leave out entities and document types", where) from None


def robot_file(folder: Path, name: str, allow_outside: bool, where: str) -> Path:
    """Return the path of a file that another one names, "package://" left out.

    Args:
        folder: of the file that names it. name: as written there. allow_outside: whether it may lie outside the folder.
        where: what names it, for messages.

    Raises:
        SceneError: there is none, or `named_file` refuses it.

    """
    if not name.startswith("package://"):
        ways = [named_file(folder, name.removeprefix("file://"), allow_outside, where)]
    else:
        package, _, rest = name.removeprefix("package://").partition("/")
        ways = [folder / package / rest, folder / rest]
        if allow_outside:
            above = [folder.resolve(), *folder.resolve().parents]
            ways += [root / package / rest for root in above] + [root / rest for root in above if root.name == package]
    found = next((way for way in ways if way.is_file()), None)
    if found is None:
        hint = "" if allow_outside else ", or give allow_outside=True where it lies in a folder above"
        raise SceneError(f"there is no file {name!r}", f"put it beside the file that names it{hint}", where)
    return named_file(folder, name, allow_outside, where, found)
