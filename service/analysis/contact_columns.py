"""The columns of the tables of contacts: name, type, unit, frame and meaning.

`python -m contactsense.service.analysis.contact_columns` prints the table of docs/analysis.md.
"""

from typing import NamedTuple

import pyarrow as pa

AXES = ("x", "y", "z")
"""Endings of the columns of a vector."""
PAIRS = (("xx", 0, 0), ("xy", 0, 1), ("xz", 0, 2), ("yy", 1, 1), ("yz", 1, 2), ("zz", 2, 2))
"""Endings of the columns of a symmetric matrix, with the row and the column of each."""


class ContactColumns(NamedTuple):
    """Columns that belong together, or a single one."""

    names: tuple[str, ...]
    kind: pa.DataType
    """Their type."""
    meaning: str
    """What they state, whole sentences."""
    unit: str = ""
    """Empty where there is none."""
    frame: str = ""
    """Frame of a place, axes of a vector: `base` or `link`; empty for others."""


def _one(name: str, kind: pa.DataType, meaning: str, unit: str = "") -> ContactColumns:
    return ContactColumns((name,), kind, meaning, unit)


def _vector(name: str, meaning: str, unit: str, frame: str) -> ContactColumns:
    return ContactColumns(tuple(f"{name}_{axis}" for axis in AXES), pa.float64(), meaning, unit, frame)


COLUMNS = (
    _one(
        "recording",
        pa.string(),
        "The file, as seen from the folder of this table; of a dataset its path within that.",
    ),
    _one("row", pa.int64(), "Row of the first sample in the file, from 0, without the header."),
    _one("row_end", pa.int64(), "Row after the last sample."),
    _one("contact", pa.int64(), "Number of the contact in the recording, from 1."),
    _one("begin", pa.float64(), "Time of the first sample, on the robot's clock.", "s"),
    _one("duration", pa.float64(), "Time from the first to the last sample.", "s"),
    _one("complete", pa.bool_(), "Whether the recording contains the end of the contact."),
    _one(
        "link",
        pa.string(),
        "The most probable link; empty where no single push on a touchable link explains the contact.",
    ),
    _one(
        "link_index",
        pa.int64(),
        "Number of that link: 0 is the base, a tool comes after the last link; -1 without a link.",
    ),
    _one("probability", pa.float64(), "Probability of this link and place."),
    _one(
        "link_probability",
        pa.list_(pa.float64()),
        "Probability of each link, by its number. The rest to 1 is that of no single push on one of them.",
    ),
    _vector("point", "Contact point. The frame of a tool is that of the flange.", "m", "link"),
    _vector("point_base", "Contact point at `peak_time`.", "m", "base"),
    _vector("normal_base", "Outward unit normal of the link there, at `peak_time`.", "", "base"),
    ContactColumns(
        tuple(f"covariance_{name}" for name, _, _ in PAIRS),
        pa.float64(),
        "Covariance of `point_base`, which is symmetric.",
        "m²",
        "base",
    ),
    _vector("force_base", "The largest force on the robot.", "N", "base"),
    _one(
        "peak_force",
        pa.float64(),
        "Its magnitude. Without a link it is that of the base sensor, and 0 without such a sensor.",
        "N",
    ),
    _one("peak_time", pa.float64(), "Time at which it acted, on the robot's clock.", "s"),
    _one("transient_force", pa.float64(), "Largest force in the first half second.", "N"),
    _one(
        "quasi_static_force",
        pa.float64(),
        "Largest force after the first half second; 0 for shorter contacts.",
        "N",
    ),
    _one("impulse", pa.float64(), "Integral of the magnitude of the force over time.", "N s"),
    _one("torsion", pa.float64(), "Moment on the robot about the outward normal, at `peak_time`.", "Nm"),
    _one("speed", pa.float64(), "Speed of the arm at the contact point when the contact began.", "m/s"),
    _one("slides", pa.bool_(), "Whether the contact point moved for longer than it was at rest."),
    _one(
        "energy",
        pa.float64(),
        'Largest energy of "nothing touches": half the sum of the squared residuals, each in units of its '
        "variance.",
    ),
    _one("q", pa.list_(pa.float64()), "Joint positions at `peak_time`.", "rad"),
    _one(
        "silent",
        pa.float64(),
        "Time within the contact for which a sensor of the scene was silent or settled: forces and impulse "
        "are those of the other samples, or of the other sensors alone.",
        "s",
    ),
    _one(
        "smoothed",
        pa.bool_(),
        "Whether link, place and probabilities were determined from the whole contact, not from the samples "
        "up to each time.",
    ),
)
"""All columns, in their order."""


def contact_schema() -> pa.Schema:
    """The columns as an Arrow schema; the metadata of a field has `description`, `unit` and `frame`."""
    return pa.schema(
        [
            pa.field(name, columns.kind, metadata=_metadata(columns))
            for columns in COLUMNS
            for name in columns.names
        ]
    )


def _metadata(columns: ContactColumns) -> dict[str, str]:
    known = {"description": columns.meaning, "unit": columns.unit, "frame": columns.frame}
    return {key: text for key, text in known.items() if text}


def columns_in_markdown() -> str:
    """The columns as a table in Markdown."""
    rows = ["| column | unit | frame | meaning |", "| --- | --- | --- | --- |"]
    for columns in COLUMNS:
        names = ", ".join(f"`{name}`" for name in columns.names)
        rows.append(f"| {names} | {columns.unit} | {columns.frame} | {columns.meaning} |")
    return "\n".join(rows)


if __name__ == "__main__":
    print(columns_in_markdown())
