"""The columns of the tables of contacts: each is described, in the files as well."""

from dataclasses import fields
from pathlib import Path

import pyarrow.parquet as pa_parquet

from contactsense.service.analysis.contact_columns import COLUMNS, columns_in_markdown
from contactsense.service.analysis.contact_table import SCHEMA, contact_table, write_contacts
from contactsense.service.analysis.summary.contact_summary import ContactSummary


def test_every_field_of_a_contact_but_the_curve_is_a_column() -> None:
    own = {field.name for field in fields(ContactSummary)} - {"curve"}
    columns = {one.names[0].removesuffix("_xx").removesuffix("_x") for one in COLUMNS}
    assert columns == own


def test_every_column_is_described() -> None:
    text = columns_in_markdown()
    for field in SCHEMA:
        assert f"`{field.name}`" in text
        assert field.metadata[b"description"].endswith(b".")


def test_parquet_has_units_and_frames(tmp_path: Path) -> None:
    write_contacts(contact_table([]), tmp_path)
    schema = pa_parquet.read_schema(tmp_path / "contacts.parquet")
    assert schema.names == SCHEMA.names
    covariance = schema.field("covariance_xy").metadata
    assert (covariance[b"unit"].decode(), covariance[b"frame"]) == ("m²", b"base")
    assert schema.field("point_x").metadata[b"frame"] == b"link"
    assert b"unit" not in schema.field("slides").metadata
