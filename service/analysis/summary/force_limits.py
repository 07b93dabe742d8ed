"""Comparison of forces with limits that the user provides. No table of a standard is included, and this is
not a conformity test."""

from pathlib import Path
from typing import Self

from pydantic import Field, PositiveFloat, ValidationError, model_validator

from contactsense.robots.files.file_model import FileModel
from contactsense.robots.files.yaml_fields import read_fields
from contactsense.scene import describe
from contactsense.service.analysis.summary.contact_summary import ContactSummary

DISCLAIMER = (
    "Forces are estimates from sensors of the arm; pressure is not measured. This is no conformity test."
)


class LimitsError(ValueError):
    """A file of limits that cannot be used: the message names the file, the field and the expected value."""


class RegionLimit(FileModel):
    """Limits for one region of the body."""

    name: str
    """The region, such as `hand`."""
    quasi_static: PositiveFloat
    """Largest quasi-static force [N]."""
    transient: PositiveFloat
    """Largest transient force, in the first half second [N]."""


class ForceLimits(FileModel):
    """Limits by region of the body, and where they come from."""

    provenance: str = Field(min_length=1)
    """Where the limits come from; printed with every result."""
    regions: tuple[RegionLimit, ...] = Field(min_length=1)
    """The regions."""

    @model_validator(mode="after")
    def _has_distinct_names(self) -> Self:
        names = [region.name for region in self.regions]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ValueError(f"regions: expected distinct names, got {twice[0]!r} twice")
        return self

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read limits from a YAML file.

        Raises:
            LimitsError: the file is missing or is not valid YAML, or a field is wrong; the message names it.
        """
        try:
            content = read_fields(path, "the limits", "regions:")
        except ValueError as error:
            raise LimitsError(str(error)) from None
        try:
            return cls.model_validate(content)
        except ValidationError as error:
            raise LimitsError(f"{path}: {describe(error, cls)}") from None

    @property
    def doubts(self) -> tuple[str, ...]:
        """What in the limits is likely to be a mistake, one sentence for each region."""
        return tuple(
            f"Limits of {region.name}: the transient one, {region.transient:g} N, is below the quasi-static "
            f"one, {region.quasi_static:g} N: are they in each other's place?"
            for region in self.regions
            if region.transient < region.quasi_static
        )

    def exceeded(self, contact: ContactSummary) -> list[str]:
        """Regions whose limits the contact exceeds, one phrase each."""
        found = []
        for region in self.regions:
            for kind, force, limit in (
                ("transient", contact.transient_force, region.transient),
                ("quasi-static", contact.quasi_static_force, region.quasi_static),
            ):
                if force > limit:
                    found.append(f"{region.name}: {force:.1f} N above {limit:g} N ({kind})")
        return found
