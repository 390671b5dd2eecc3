"""Lists in a query: one value with commas between its parts, or several values."""

from __future__ import annotations


def split_commas(value: object) -> object:
    """`include=a,b` and `include=a&include=b` mean the same in a query; what is no list is left as it is."""
    if isinstance(value, list):
        return [part for each in value for part in str(each).split(",")]
    return value
