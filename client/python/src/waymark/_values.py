"""JSON and protobuf messages to frozen dataclasses, and back.

In: parsed JSON, or a message. Out: a value of the dataclass asked for. Fields are matched by name; fields that the
dataclass does not have are ignored, so that a newer server can say more. Enumerations are lower-case words in both.
"""

from __future__ import annotations

import dataclasses
import functools
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from google.protobuf.descriptor import EnumDescriptor, FieldDescriptor
from google.protobuf.message import Message

T = TypeVar("T")
_Read = Callable[[Any], Any]

# Metadata of a field: what stands for null; all fields of the object that have no field of their own.
NULL = "null"
REST = "rest"
# Metadata of a field: its name in JSON, where that is no name of Python's.
NAME = "name"


class MismatchError(Exception):
    """The value does not have the shape of the dataclass."""


class Unset:
    """What an argument is that was not given, where `None` means "forget it"."""

    def __repr__(self) -> str:
        return "UNSET"


UNSET = Unset()


def from_json(kind: type[T], value: Any) -> T:
    """A value of `kind`, which is a dataclass, from parsed JSON."""
    which: Any = kind
    read = _json_reader(which)
    try:
        return typing.cast(T, read(value))
    except (TypeError, ValueError, AttributeError, KeyError) as error:
        raise MismatchError(f"{kind.__name__}: {error}") from error


def from_message(kind: type[T], message: Message) -> T:
    """A value of `kind`, which is a dataclass, from a message of the same fields."""
    which: Any = kind
    return typing.cast(T, _message_reader(which, message.DESCRIPTOR.full_name)(message))


def to_json(value: Any) -> Any:
    """Dataclasses to what `json` writes; fields that are `None` are left out."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = ((f.metadata.get(NAME, f.name), getattr(value, f.name)) for f in dataclasses.fields(value))
        return {name: to_json(each) for name, each in fields if each is not None}
    if isinstance(value, Mapping):
        return {name: to_json(each) for name, each in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [to_json(each) for each in value]
    return value


def given(**fields: Any) -> dict[str, Any]:
    """The arguments that were given, as JSON: of a PATCH, `None` is a value."""
    return {name: to_json(value) for name, value in fields.items() if not isinstance(value, Unset)}


def present(**fields: Any) -> dict[str, Any]:
    """The arguments that are not `None`, as JSON."""
    return {name: to_json(value) for name, value in fields.items() if value is not None}


def fill(message: Message, value: Any) -> None:
    """Writes the fields of a dataclass into a message; those that are `None` stay absent."""
    # A message that a field was written to is present, even where all are zero.
    for name, each in ((f.name, getattr(value, f.name)) for f in dataclasses.fields(value)):
        if each is None:
            continue
        if dataclasses.is_dataclass(each):
            fill(getattr(message, name), each)
        elif isinstance(each, tuple | list):
            getattr(message, name).extend(each)
        else:
            field = message.DESCRIPTOR.fields_by_name[name]
            number = _number(field.enum_type, each) if field.enum_type is not None else each
            setattr(message, name, number)


def _optional(kind: Any) -> Any:
    """The other part of `X | None`; `None` for any other type."""
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        parts = [part for part in typing.get_args(kind) if part is not type(None)]
        if len(parts) == 1:
            return parts[0]
    return None


@functools.cache
def _json_reader(kind: Any) -> _Read:
    inner = _optional(kind)
    if inner is not None:
        read = _json_reader(inner)
        return lambda value: None if value is None else read(value)
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is tuple:
        if arguments[-1] is Ellipsis:
            each = _json_reader(arguments[0])
            return lambda values: tuple(each(value) for value in values)
        readers = [_json_reader(argument) for argument in arguments]
        return lambda values: tuple(read(value) for read, value in zip(readers, values, strict=True))
    if origin is dict:
        each = _json_reader(arguments[1])
        return lambda values: {name: each(value) for name, value in values.items()}
    if dataclasses.is_dataclass(kind):
        return _json_object(kind)
    # Whole numbers of JSON are numbers, too; booleans are not.
    return float if kind is float else _same


def _json_object(kind: Any) -> _Read:
    hints = typing.get_type_hints(kind)
    fields = dataclasses.fields(kind)
    readers = [
        (f.name, f.metadata.get(NAME, f.name), _json_reader(hints[f.name]), f.metadata.get(NULL))
        for f in fields
        if REST not in f.metadata
    ]
    rest = next((f.name for f in fields if REST in f.metadata), None)
    known = {in_json for _, in_json, _, _ in readers}
    needed = [
        f.metadata.get(NAME, f.name)
        for f in fields
        if f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING and REST not in f.metadata
    ]

    def read(value: Any) -> Any:
        if not isinstance(value, dict):
            raise TypeError(f"an object is expected, not {value!r:.60}")
        missing = [name for name in needed if name not in value]
        if missing:
            raise KeyError(f"{', '.join(missing)} missing")
        given = {
            name: null if null is not None and value[in_json] is None else read(value[in_json])
            for name, in_json, read, null in readers
            if in_json in value
        }
        if rest is not None:
            given[rest] = {name: each for name, each in value.items() if name not in known}
        return kind(**given)

    return read


def _same(value: Any) -> Any:
    return value


@functools.cache
def _message_reader(kind: Any, full_name: str) -> _Read:
    descriptor = _descriptor(full_name)
    hints = typing.get_type_hints(kind)
    readers: list[tuple[str, bool, _Read]] = []
    for field in dataclasses.fields(kind):
        hint = hints[field.name]
        wire = descriptor.fields_by_name[field.name]
        inner = _optional(hint)
        readers.append((field.name, inner is not None, _field_reader(inner or hint, wire)))

    def read(message: Any) -> Any:
        return kind(
            **{
                name: None if is_optional and not message.HasField(name) else read(getattr(message, name))
                for name, is_optional, read in readers
            }
        )

    return read


def _field_reader(hint: Any, wire: FieldDescriptor) -> _Read:
    each: _Read | None = None
    is_list = typing.get_origin(hint) is tuple
    if wire.message_type is not None:
        kind = typing.get_args(hint)[0] if is_list else hint
        each = _message_reader(kind, wire.message_type.full_name)
    elif wire.enum_type is not None:
        known = _words(wire.enum_type)
        each = lambda number: known.get(number, "unspecified")  # noqa: E731
    if not is_list:
        return each or _same
    if each is None:
        return tuple
    of_one = each
    return lambda values: tuple(of_one(value) for value in values)


def _descriptor(full_name: str) -> Any:
    from waymark.v1 import waymark_pb2

    return waymark_pb2.DESCRIPTOR.message_types_by_name[full_name.rsplit(".", 1)[1]]


@functools.cache
def _words(enum: EnumDescriptor) -> dict[int, str]:
    """Words of an enumeration by number: without the prefix that all of its names have."""
    prefix = enum.values_by_number[0].name.removesuffix("UNSPECIFIED")
    return {value.number: value.name.removeprefix(prefix).lower() for value in enum.values}


def _number(enum: Any, word: str) -> int:
    for number, known in _words(enum).items():
        if known == word:
            return number
    raise ValueError(f"{word!r} is none of {', '.join(_words(enum).values())}")
