"""What all bodies of requests have in common."""

from pydantic import BaseModel, ConfigDict


class RequestBody(BaseModel):
    """A body of JSON. It has no unknown fields, and values have the type that the interface states: "yes" is
    no boolean and "1" is no number. Numbers are finite."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)
