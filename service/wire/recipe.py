"""A recipe: which fields a data package holds, and in which order."""

import struct
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from contactsense.service.wire.rtde_fields import TYPE_CODES, WIDTHS

HEADER = struct.Struct(">HB")
"""Frame header: size of the whole frame including this header, and package type."""

Number = float | int | bool


class RtdeProtocolError(Exception):
    """The bytes are not RTDE, or not what was agreed; the text states what was expected and received."""


class RtdeFieldError(RtdeProtocolError):
    """The controller refuses fields of a recipe; `not_found` and `in_use` hold their names."""

    def __init__(self, not_found: Sequence[str] = (), in_use: Sequence[str] = ()) -> None:
        self.not_found = tuple(not_found)
        self.in_use = tuple(in_use)
        parts = []
        if not_found:
            parts.append(f"the controller does not know {', '.join(not_found)}")
        if in_use:
            parts.append(f"another client already writes {', '.join(in_use)}")
        super().__init__("; ".join(parts))


class Recipe:
    """Layout of a data package; packing and unpacking are one precompiled `struct` call.

    Args:
        recipe_id: Number that the controller assigned to the recipe, 0 to 255.
        names: Fields, in order.
        types: RTDE type of each field, in the same order.

    Raises:
        RtdeFieldError: A type states that the field does not exist or is in use.
        RtdeProtocolError: A type is unknown, or the lists differ in length.
    """

    __slots__ = ("_struct", "names", "recipe_id", "size", "slices", "types")

    def __init__(self, recipe_id: int, names: Sequence[str], types: Sequence[str]) -> None:
        if len(names) != len(types):
            raise RtdeProtocolError(f"expected {len(names)} types for {len(names)} fields, got {len(types)}")
        refused = [n for n, t in zip(names, types, strict=True) if t == "NOT_FOUND"]
        taken = [n for n, t in zip(names, types, strict=True) if t == "IN_USE"]
        if refused or taken:
            raise RtdeFieldError(refused, taken)
        unknown = [t for t in types if t not in TYPE_CODES]
        if unknown:
            raise RtdeProtocolError(f"expected one of the types {', '.join(TYPE_CODES)}, got {unknown[0]!r}")
        self.recipe_id = recipe_id
        self.names = tuple(names)
        self.types = tuple(types)
        self._struct = struct.Struct(">x" + "".join(TYPE_CODES[t] for t in types))
        self.size = HEADER.size + self._struct.size
        """Size of a whole data frame of this recipe [bytes]."""
        slices: dict[str, slice] = {}
        start = 0
        for name, kind in zip(names, types, strict=True):
            slices[name] = slice(start, start + WIDTHS[kind])
            start += WIDTHS[kind]
        self.slices: Mapping[str, slice] = MappingProxyType(slices)
        """Field name -> slice of its numbers in the unpacked data."""

    def unpack(self, payload: bytes) -> tuple[Number, ...]:
        """Unpack all numbers of a data package, in order; `slices` maps them to fields.

        Raises:
            RtdeProtocolError: The size is wrong, or the number is that of another recipe.
        """
        if len(payload) != self._struct.size:
            raise RtdeProtocolError(
                f"expected a data package of {self._struct.size} bytes, got {len(payload)} bytes"
            )
        if payload[0] != self.recipe_id:
            raise RtdeProtocolError(f"expected data of recipe {self.recipe_id}, got recipe {payload[0]}")
        return self._struct.unpack(payload)

    def pack(self, values: Sequence[Number]) -> bytes:
        """Pack these numbers into a whole data frame."""
        frame = bytearray(self.size)
        HEADER.pack_into(frame, 0, self.size, ord("U"))
        self._struct.pack_into(frame, HEADER.size, *values)
        frame[HEADER.size] = self.recipe_id
        return bytes(frame)
