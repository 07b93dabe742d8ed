"""Contacts as a table: Parquet for programs, CSV for people."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as pa_csv

from contactsense.robots.files.whole_file import whole_file
from contactsense.service.analysis.contact_columns import AXES, PAIRS, contact_schema
from contactsense.service.analysis.summary.contact_summary import ContactSummary
from contactsense.service.recordings.tables.parquet_files import write_parquet

SCHEMA = contact_schema()
"""Columns of the table of contacts, see `contactsense.service.analysis.contact_columns`."""


def contact_rows(contacts: Iterable[ContactSummary]) -> list[dict[str, Any]]:
    """One dictionary per contact, with the columns of `SCHEMA`; unknown numbers are None."""
    rows = [_row(contact) for contact in contacts]
    return [{name: None if isinstance(x, float) and x != x else x for name, x in row.items()} for row in rows]


def contact_table(contacts: Iterable[ContactSummary]) -> pa.Table:
    """One row per contact, with the columns of `SCHEMA`."""
    return pa.Table.from_pylist([_row(contact) for contact in contacts], schema=SCHEMA)


def write_contacts(table: pa.Table, folder: Path) -> None:
    """Write `contacts.parquet` and `contacts.csv`; existing files are replaced atomically."""
    write_parquet(table, folder / "contacts.parquet")
    flat = table
    for name in ("link_probability", "q"):
        texts = [" ".join(f"{x:.6g}" for x in values) for values in table[name].to_pylist()]
        index = flat.schema.get_field_index(name)
        flat = flat.set_column(index, name, pa.array(texts, pa.string()))
    with whole_file(folder / "contacts.csv") as unfinished:
        pa_csv.write_csv(flat, unfinished)


def from_folder(table: pa.Table, recording: Path, folder: Path) -> pa.Table:
    """The table with the path of its recording as seen from the folder in which it is written: it is found
    from any working directory, and when both are moved together."""
    try:
        path = Path(os.path.relpath(recording.resolve(), folder.resolve()))
    except ValueError:  # on another drive
        path = recording.resolve()
    names = pa.array([path.as_posix()] * len(table), pa.string())
    return table.set_column(table.schema.get_field_index("recording"), "recording", names)


def _row(contact: ContactSummary) -> dict[str, object]:
    plain = (
        "recording", "row", "row_end", "contact", "begin", "duration", "complete", "link", "link_index",
        "probability", "peak_force", "peak_time", "transient_force", "quasi_static_force", "impulse",
        "torsion", "speed", "slides", "energy", "silent", "smoothed",
    )  # fmt: skip
    row: dict[str, object] = {name: getattr(contact, name) for name in plain}
    for name in ("point", "point_base", "normal_base", "force_base"):
        row |= {f"{name}_{a}": float(x) for a, x in zip(AXES, getattr(contact, name), strict=True)}
    row |= {f"covariance_{name}": float(contact.covariance[i, k]) for name, i, k in PAIRS}
    row["link_probability"] = contact.link_probability.tolist()
    row["q"] = contact.q.tolist()
    return row
