"""Words about fields are found when they are looked at."""

from __future__ import annotations

from pydantic import BaseModel, Field

from service.allowed import Words, allowed_fields


class Asked(BaseModel):
    number: float = Field(ge=1, le=3)


def test_words_of_a_model_are_those_of_its_schema():
    assert dict(Words.of(Asked)) == allowed_fields(Asked.model_json_schema()) == {"number": "1 to 3"}


def test_nothing_is_found_out_before_somebody_looks():
    found = []

    def find():
        found.append(True)
        return {"a": "b"}

    words = Words(find)
    assert not found
    assert (words["a"], len(words), list(words), "c" in words) == ("b", 1, ["a"], False)
    assert found == [True]
