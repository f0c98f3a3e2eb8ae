"""What a column map says of how a file is a table."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator, model_validator

from ...core.models import FileModel


class FileLayout(FileModel):
    """What is known of how a file is a table; the rest is guessed (:class:`.table_files.Layout`)."""

    separator: str | None = Field(default=None, description="between fields: one sign, or tab")
    decimal: Literal[".", ","] | None = Field(default=None, description="decimal sign")
    encoding: str | None = Field(default=None, description="of the text, as Python names it")
    header_row: int | None = Field(default=None, ge=1, le=1000, description="line of the names")
    unit_row: int | None = Field(default=None, ge=1, le=1000, description="line of the units")
    sheet: str | None = Field(default=None, description="of a spreadsheet; the first by default")

    @field_validator("separator")
    @classmethod
    def _one_sign(cls, value: str | None) -> str | None:
        value = "\t" if value == "tab" else value
        if value is not None and (len(value) != 1 or value.isalnum() or value in "\r\n.\"'"):
            raise ValueError(f"{value!r} (allowed: one sign such as ; , | or tab)")
        return value

    @field_validator("encoding")
    @classmethod
    def _encoding(cls, value: str | None) -> str | None:
        try:
            "".encode(value or "utf-8")  # refuses what turns bytes into bytes, as zip does
        except LookupError:
            raise ValueError(f"{value!r} is unknown (utf-8, utf-16, cp1252, ...)") from None
        return value

    @model_validator(mode="after")
    def _one_meaning(self) -> FileLayout:
        if self.separator is not None and self.separator == self.decimal:
            raise ValueError(
                f"separator and decimal are both {self.separator!r}; one of them is not"
            )
        return self
