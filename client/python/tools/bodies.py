"""The bodies of the HTTP interface as dataclasses, of its OpenAPI document. In: the document. Out: Python source.

A schema with properties is a frozen dataclass, an enumeration a `Literal`, a list of fixed length a tuple. What is a
message of `waymark.proto`, too, is that of `waymark.wire`.
"""

from __future__ import annotations

import json
import keyword
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# Names that differ from those of the document, beside enumerations, which have no `Body`.
OTHER_NAMES = {"ListOrder": "Order", "MapChangeBody": "LiveMapChange"}
# Schemas that are no type here, with the reason.
NOT_HERE = {
    # Raised as `Refused`.
    "Problem",
    # With `missed` as a type of its own: `waymark.api.live.LiveEvent`.
    "LiveEventData",
    # Forms are sent part by part, by the methods.
    "LocaliseForm",
    "NewViewForm",
    "PhotographForm",
    "UnderlayForm",
}
# Bodies that only share their name with a message.
NOT_OF_THE_WIRE = {"RobotPose", "ServerEvent"}
# Fields of which null says that nothing is known: infinite.
INFINITE = {"fx_sigma_px", "cx_sigma_px", "cy_sigma_px"}
# What a class does beside holding its fields.
METHODS = {"FailedGate": 'def __str__(self) -> str:\n    return f"{self.sentence} {self.advice}"'}
# Longest list of fixed length that is a tuple with a type for each item.
MAX_ITEMS = 4
# Where all further fields of an object go.
REST = "facts"
# Values of fields that may be absent and have no default in the document.
NOTHING = {"str": '""', "int": "0", "float": "0.0", "bool": "False"}
WIDTH = 116

Schema = dict[str, Any]


def bodies(document: Path, wire: Path) -> str:
    """The source of all bodies; those that `wire` has are imported from there."""
    of_the_wire = set(re.findall(r"^(?:class )?([A-Z]\w*)(?::| = Literal)", wire.read_text(), re.MULTILINE))
    of_the_wire -= NOT_OF_THE_WIRE
    return _Bodies(json.loads(document.read_text())["components"]["schemas"], of_the_wire).source()


class _Bodies:
    def __init__(self, schemas: dict[str, Schema], of_the_wire: set[str]) -> None:
        self.schemas = schemas
        self.of_the_wire = of_the_wire
        # A page is a type only where a body holds it: the methods yield the items of others.
        held = {name for schema in schemas.values() for name in _references(schema)}
        self.here = sorted(
            name
            for name in schemas
            if not (name in NOT_HERE or name in of_the_wire or (name.startswith("Page_") and name not in held))
        )
        self.imported: set[str] = set()

    def source(self) -> str:
        aliases = [self.alias(name) for name in self.in_order()]
        classes = [self.dataclass(name) for name in self.here if not self.is_alias(name)]
        names = sorted(self.name(name) for name in self.here)
        listed = ",\n".join(f'    "{name}"' for name in names)
        text = "\n".join(aliases) + "\n\n\n" + "\n\n\n".join(classes)
        used = [name for name in ("NAME", "NULL", "REST") if re.search(rf"\b{name}\b", text)]
        return (
            '"""The bodies of the HTTP interface; its OpenAPI document says the same."""\n\n'
            "from __future__ import annotations\n\nimport math\nfrom dataclasses import dataclass, field\n"
            "from typing import Any, Literal\n\n"
            f"from waymark._values import {', '.join(used)}\n"
            f"from waymark.wire import {', '.join(sorted(self.imported))}\n\n"
            f"__all__ = [\n{listed},\n]\n\n{text}\n"
        )

    def name(self, name: str) -> str:
        """The name here of a schema."""
        if name.startswith("Page_"):
            return f"{name.removeprefix('Page_')}Page"
        is_words = "enum" in self.schemas[name]
        return OTHER_NAMES.get(name, name.removesuffix("Body") if is_words else name)

    def is_alias(self, name: str) -> bool:
        """Words, and lists of fixed length."""
        return "enum" in self.schemas[name] or self.schemas[name].get("type") == "array"

    def in_order(self) -> list[str]:
        """The aliases, each after those that it is made of."""
        done: list[str] = []
        left = [name for name in self.here if self.is_alias(name)]
        while left:
            ready = [name for name in left if not set(_references(self.schemas[name])) & set(left)]
            done += ready
            left = [name for name in left if name not in ready]
        return done

    def alias(self, name: str) -> str:
        comment = _wrapped(self.schemas[name].get("description", ""), WIDTH)
        lines = "".join(f"# {line}\n" for line in comment)
        return f"{lines}{self.name(name)} = {self.type(self.schemas[name])}"

    def type(self, schema: Schema) -> str:
        """The type of a value, as an annotation: each of several once, `None` last."""
        types = dict.fromkeys(self.types(schema))
        return " | ".join(sorted(types, key=lambda each: each == "None")) or "Any"

    def types(self, schema: Schema) -> list[str]:
        """What a value may be."""
        if "$ref" in schema:
            name = schema["$ref"].rsplit("/", 1)[1]
            if name in self.of_the_wire:
                self.imported.add(name)
            return [self.name(name)]
        if "oneOf" in schema:
            return [each for one in schema["oneOf"] for each in self.types(one)]
        kinds = schema.get("type", [])
        return [self.of_kind(kind, schema) for kind in ([kinds] if isinstance(kinds, str) else kinds)]

    def of_kind(self, kind: str, schema: Schema) -> str:
        if "enum" in schema:
            return f"Literal[{', '.join(json.dumps(word) for word in schema['enum'])}]"
        if kind == "array" and "prefixItems" in schema:
            return f"tuple[{', '.join(self.type(item) for item in schema['prefixItems'])}]"
        if kind == "array":
            item, count = self.type(schema["items"]), schema.get("maxItems", MAX_ITEMS + 1)
            is_fixed = count == schema.get("minItems") and count <= MAX_ITEMS
            return f"tuple[{', '.join([item] * count)}]" if is_fixed else f"tuple[{item}, ...]"
        if kind == "object":
            values = schema.get("additionalProperties")
            return f"dict[str, {self.type(values) if isinstance(values, dict) else 'Any'}]"
        return {"string": "str", "integer": "int", "number": "float", "boolean": "bool", "null": "None"}[kind]

    def dataclass(self, name: str) -> str:
        fields, needed = _fields(self.schemas, self.schemas[name])
        ordered = sorted(fields, key=lambda field: field not in needed)
        text = [_docstring(self.schemas[name].get("description", name), "    ")]
        for field in ordered:
            said = fields[field]
            text.append(f"    {self.field(field, said, field in needed)}")
            parts = [part for part in (said, *said.get("oneOf", [])) if "description" in part]
            if parts:
                text.append(_docstring(parts[0]["description"], "    "))
        if isinstance(self.schemas[name].get("additionalProperties"), dict):
            text.append(f"    {REST}: dict[str, Any] = field(default_factory=dict, metadata={{REST: True}})")
            text.append(_docstring(self.schemas[name]["additionalProperties"]["description"], "    "))
        if name in METHODS:
            text.append("\n" + textwrap.indent(METHODS[name], "    "))
        body = "\n".join(text)
        return f"@dataclass(frozen=True, slots=True)\nclass {self.name(name)}:\n{body}"

    def field(self, field: str, said: Schema, is_needed: bool) -> str:
        """A line of a dataclass."""
        name = {"type": "kind"}.get(field, f"{field}_" if keyword.iskeyword(field) else field)
        kind = self.type(said)
        more: dict[str, str] = {}
        metadata: dict[str, str] = {}
        if name != field:
            metadata["NAME"] = json.dumps(field)
        if field in INFINITE:
            kind, metadata["NULL"] = kind.removesuffix(" | None"), "math.inf"
        if said.get("format") == "password":
            more["repr"] = "False"
        if not is_needed:
            kind, value = self.otherwise(kind, said)
            more["default_factory" if value in ("dict",) else "default"] = value
        if metadata:
            more["metadata"] = "{" + ", ".join(f"{key}: {value}" for key, value in metadata.items()) + "}"
        if more.keys() == {"default"}:
            return f"{name}: {kind} = {more['default']}"
        made = ", ".join(f"{key}={value}" for key, value in more.items())
        return f"{name}: {kind} = field({made})" if made else f"{name}: {kind}"

    def otherwise(self, kind: str, said: Schema) -> tuple[str, str]:
        """Type and value of a field that may be absent."""
        default = said.get("default")
        if isinstance(default, str | int | float):
            return kind, repr(default)
        if kind.startswith("dict["):
            return kind, "dict"
        if kind.startswith("tuple[") and not kind.endswith("None") and "maxItems" not in said:
            return kind, "()"
        if kind in NOTHING:
            return kind, NOTHING[kind]
        return (kind if kind.endswith("None") or kind == "Any" else f"{kind} | None"), "None"


def _references(schema: Any) -> Iterator[str]:
    """Names of the schemas that this one is made of."""
    if isinstance(schema, dict):
        if "$ref" in schema:
            yield schema["$ref"].rsplit("/", 1)[1]
        for each in schema.values():
            yield from _references(each)
    elif isinstance(schema, list):
        for each in schema:
            yield from _references(each)


def _fields(schemas: dict[str, Schema], schema: Schema) -> tuple[dict[str, Schema], set[str]]:
    """The fields of an object and which of them it always has. Of several forms with a word that tells which it is:
    that word, and all of their fields."""
    if "$ref" in schema:
        return _fields(schemas, schemas[schema["$ref"].rsplit("/", 1)[1]])
    if "allOf" in schema:
        fields: dict[str, Schema] = {}
        needed: set[str] = set()
        # The part of its own comes last.
        for part in reversed(schema["allOf"]):
            of_part, needed_of_part = _fields(schemas, part)
            fields |= of_part
            needed |= needed_of_part
        return fields, needed
    if "oneOf" in schema:
        forms = [_fields(schemas, form) for form in schema["oneOf"]]
        needed = set.intersection(*(needed for _, needed in forms))
        tag = next(name for name in needed if all("enum" in form[name] for form, _ in forms))
        words = [word for form, _ in forms for word in form[tag]["enum"]]
        fields = {tag: {"type": "string", "enum": words, "description": "Which of these it is."}}
        for name, said in ((name, said) for form, _ in forms for name, said in form.items() if name != tag):
            fields[name] = _either(fields.get(name, {"type": "null"}), said)
        return fields, {tag} | {name for name in needed if all(form[name] == forms[0][0][name] for form, _ in forms)}
    return schema.get("properties", {}), set(schema.get("required", []))


def _either(one: Schema, other: Schema) -> Schema:
    """A field that forms have otherwise, or not at all."""
    descriptions = [said["description"] for said in (one, other) if "description" in said]
    return {"oneOf": [one, other], **({"description": descriptions[0]} if descriptions else {})}


def _wrapped(text: str, width: int) -> list[str]:
    return textwrap.wrap(" ".join(text.split()), width)


def _docstring(text: str, indent: str) -> str:
    whole = f"\n{indent}".join(_wrapped(text, WIDTH - len(indent) - 4))
    return f'{indent}"""{whole}"""'.replace("\\", "\\\\")
