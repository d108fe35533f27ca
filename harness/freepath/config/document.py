"""YAML with the position of every key and value, read so that all mistakes are found at once.

The text is composed to ruamel.yaml's nodes, which know where they stand, and turned into plain
Python values here, so that a mistake in one value does not hide those in others.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from freepath.config.base import INSIDE_KIND, MOST_PROBLEMS, UNKNOWN_KEY, UNKNOWN_KIND
from freepath.config.rules import shown
from freepath.errors import ConfigError, Problem

Location = tuple[str | int, ...]

MOST_VALUES = 20_000
"""Keys, values and lines of a text, and keys that merging copies: far beyond what a person writes,
and read within seconds."""
_TAG = "tag:yaml.org,2002:"
_MERGE = _TAG + "merge"
_TYPED = {_TAG + name for name in ("int", "float", "bool", "null")}
# dates are no values here: 2024-01-01 stays the text that it is in a description
_TEXTS = {_TAG + name for name in ("str", "timestamp", "value", "merge")}


@dataclasses.dataclass(frozen=True)
class Document:
    """A parsed text: `data` is made of dict, list, str, int, float, bool and None only."""

    name: str
    text: str
    root: Node | None
    data: Any

    @classmethod
    def parse(cls, name: str, text: str) -> Document:
        """Parse a YAML text; `name` is the file as messages call it.

        Raises ConfigError with every problem of form: syntax, duplicate or non-text keys, tags.
        """
        text = text.replace("\r\n", "\n")
        version = re.match(r"(?:\s*(?:#.*)?\n)*%YAML[ \t]+(?!1\.2\s)(\S*)", text)
        if version:
            message = f"expected YAML 1.2, got {shown(version[1])}: leave the line out"
            raise ConfigError([_problem(name, text, version.start(1), "", message)])
        if sum(text.count(mark) for mark in ":,-[{\n") > MOST_VALUES:
            message = f"expected at most {MOST_VALUES} keys, values and lines, got more"
            raise ConfigError([Problem(name, 0, 0, "", message)])
        yaml = YAML(typ="safe", pure=True)
        try:
            root = yaml.compose(text)
            document = cls(name, text, root, None)
            reader = _Reader(document, yaml)
            data = reader.value(root, ()) if root else None
        except MarkedYAMLError as error:
            raise ConfigError([_syntax_problem(name, text, error)]) from None
        except ReaderError as error:
            message = f"expected text, got the character U+{ord(_char(error)):04X}"
            raise ConfigError([_problem(name, text, error.position, "", message)]) from None
        except RecursionError:
            message = "expected a config, got lists or mappings nested too deeply"
            raise ConfigError([Problem(name, 0, 0, "", message)]) from None
        except (YAMLError, ValueError, AssertionError) as error:
            message = f"not valid YAML: {' '.join(str(error).split())}"
            raise ConfigError([Problem(name, 0, 0, "", message)]) from None
        if reader.problems:
            raise ConfigError(reader.problems)
        return dataclasses.replace(document, data=data)

    def problem(self, location: Location, message: str, kind: str = "") -> Problem:
        """Return the problem at a location of the data, with the caret where `kind` wants it."""
        path, index = self._walk(location, kind)
        if index is None or not self.text:  # of a dictionary, which has no lines
            return Problem(self.name, 0, 0, path, message)
        return _problem(self.name, self.text, index, path, message)

    def _walk(self, location: Location, kind: str) -> tuple[str, int | None]:
        """Return the path as it is shown, and the character index of the key or value meant."""
        node, key, shown_parts = self.root, None, []
        for part in location:
            if part == INSIDE_KIND and not isinstance(node, SequenceNode):
                if isinstance(node, MappingNode) and node.value:
                    key, node = node.value[0]
            elif isinstance(part, int):
                # a single value may stand for a list of one: the index is then not shown
                if isinstance(node, SequenceNode) and part < len(node.value):
                    key, node = None, node.value[part]
                    shown_parts.append(part)
            else:
                shown_parts.append(part)
                found = _find(node, part)
                key, node = found or (key, node)
        if node is None:
            return path_text(shown_parts), None
        if kind == UNKNOWN_KIND and isinstance(node, MappingNode) and node.value:
            key, node = node.value[0]
            return path_text(shown_parts), key.start_mark.index
        under_key = key is not None and (kind == UNKNOWN_KEY or _is_empty(node))
        return path_text(shown_parts), (key if under_key else node).start_mark.index

    def validate(self, model: type[BaseModel], context: Any = None) -> Any:
        """Return the data as a model; raises ConfigError with all problems in the text's order."""
        return validate(model, self.data, self.problem, context)


def validate(model: type[BaseModel], data: Any, problem: Any, context: Any = None) -> Any:
    """Validate data; `problem(location, message, kind)` says where each error stands."""
    try:
        return model.model_validate(data, context=context)
    except ValidationError as error:
        problems = {
            problem(line["loc"], line["msg"], line["type"]): None
            for line in error.errors(include_url=False)
        }
        ordered = sorted(problems, key=lambda found: (found.line, found.column))
        raise ConfigError(ordered) from None


def path_text(parts: Iterable[str | int]) -> str:
    """Return ("matrix", "medium", 1, "size") as "matrix.medium[1].size"."""
    text = ""
    for part in parts:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            name = part if part.isprintable() and " " not in part else shown(part)
            text += f".{name}" if text else name
    return text


def _find(node: Node | None, name: str) -> tuple[Node, Node] | None:
    # the last one counts: keys that come in through << stand before the mapping's own
    if isinstance(node, MappingNode):
        for key, value in reversed(node.value):
            if key.value == name:
                return key, value
    return None


def _is_empty(node: Node) -> bool:
    return isinstance(node, ScalarNode) and node.start_mark.index == node.end_mark.index


def _problem(name: str, text: str, index: int, path: str, message: str) -> Problem:
    # ruamel counts some characters as line breaks which editors do not, so lines are counted here
    index = min(index, len(text))
    start = text.rfind("\n", 0, index) + 1
    line = text[start:].split("\n", 1)[0]
    return Problem(name, text.count("\n", 0, index) + 1, index - start + 1, path, message, line)


def _char(error: ReaderError) -> str:
    return error.character if isinstance(error.character, str) else chr(error.character)


def _syntax_problem(name: str, text: str, error: MarkedYAMLError) -> Problem:
    mark, message = error.problem_mark or error.context_mark, error.problem or "syntax error"
    if "'\\t'" in message:
        message = "expected spaces, got a tab: here it is read in quotes only"
    elif "end of stream" in message or "stream end" in message:
        mark = error.context_mark or mark
        message = f"not valid YAML: what opens here is not closed ({error.context})"
    elif "another document" in message:
        message = "expected a single YAML document, got another one"
    else:
        message = f"not valid YAML: {message}"
    if mark is None:
        return Problem(name, 0, 0, "", message)
    return _problem(name, text, mark.index, "", message)


class _Reader:
    """Turns nodes into plain values and collects what is wrong with them."""

    def __init__(self, document: Document, yaml: YAML):
        self.document = document
        self.constructor = yaml.constructor
        self.problems: list[Problem] = []
        self.open: set[int] = set()
        self.merging: set[int] = set()
        self.copied = 0
        # an alias is read once, however often it is used, so that nested ones cannot explode
        self.done: dict[int, Any] = {}

    def report(self, node: Node, location: Location, message: str) -> None:
        if len(self.problems) >= MOST_PROBLEMS:
            return  # each takes a search through the text
        document, index = self.document, node.start_mark.index
        problem = _problem(document.name, document.text, index, path_text(location), message)
        self.problems.append(problem)

    def value(self, node: Node, location: Location) -> Any:
        if id(node) in self.open:
            self.report(node, location, "expected a value, got an alias that contains itself")
            return None
        if id(node) not in self.done:
            self.open.add(id(node))
            self.done[id(node)] = self._read(node, location)
            self.open.remove(id(node))
        return self.done[id(node)]

    def _read(self, node: Node, location: Location) -> Any:
        tag = str(node.tag)
        if isinstance(node, MappingNode) and tag == _TAG + "map":
            return self._mapping(node, location)
        if isinstance(node, SequenceNode) and tag == _TAG + "seq":
            return [self.value(item, (*location, i)) for i, item in enumerate(node.value)]
        if isinstance(node, ScalarNode) and tag in _TEXTS:
            return node.value
        if isinstance(node, ScalarNode) and tag in _TYPED:
            return self._scalar(node, location)
        self.report(node, location, f"expected a plain value, got the tag {shown(tag)}")
        return None

    def _scalar(self, node: Node, location: Location) -> Any:
        try:
            return self.constructor.construct_object(node, deep=True)
        except (ValueError, LookupError, ArithmeticError, YAMLError):
            self.report(node, location, f"expected a value, got {shown(node.value)}")
            return None

    def _mapping(self, node: MappingNode, location: Location) -> dict[str, Any]:
        first: dict[str, Node] = {}
        for key, _ in node.value:
            if not isinstance(key, ScalarNode) or str(key.tag) not in _TEXTS or not key.value:
                got = shown(key.value) if isinstance(key, ScalarNode) else "a list or mapping"
                self.report(key, location, f"expected a name as key, got {got}")
            elif key.value in first:
                line = first[key.value].start_mark.line + 1
                here = (*location, key.value)
                self.report(key, here, f"expected a key once, got it again (first in line {line})")
            else:
                first[key.value] = key
        self._merge(node, location)
        return {
            key.value: self.value(value, (*location, key.value))
            for key, value in node.value
            if isinstance(key, ScalarNode)
        }

    def _merge(self, node: Node, location: Location) -> list[tuple[Node, Node]]:
        """Put the pairs that come in through << before the mapping's own; return all of them.

        A key that several sources have comes in once, from the first of them, so that mappings
        that merge mappings cannot explode.
        """
        if not isinstance(node, MappingNode) or id(node) in self.merging:
            self.report(node, location, "expected a mapping, or a list of them, to merge")
            return []
        given = [value for key, value in node.value if key.tag and str(key.tag) == _MERGE]
        if given:
            self.merging.add(id(node))
            own = [(key, value) for key, value in node.value if str(key.tag) != _MERGE]
            merged: dict[str, tuple[Node, Node]] = {}
            for value in given:
                for source in value.value if isinstance(value, SequenceNode) else [value]:
                    for pair in self._merge(source, location):
                        merged.setdefault(pair[0].value, pair)
            self.copied += len(merged)
            if self.copied > MOST_VALUES:
                raise ValueError(f"merging (<<) copies more than {MOST_VALUES} keys")
            node.value = [*merged.values(), *own]
            self.merging.remove(id(node))
        return node.value
