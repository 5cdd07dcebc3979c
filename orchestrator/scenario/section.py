"""A section of a YAML file: keys that are all known, and values that are of their type already."""

from pydantic import BaseModel, ConfigDict


class Section(BaseModel):
    """What every section is: an unknown key is an error, no value is converted, and nothing is changed afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
