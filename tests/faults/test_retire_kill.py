"""Kill whoever publishes, archives, restores and deletes at any moment, while an alias moves: what was acknowledged
stays, no alias names a version that is retired, and what was begun can be finished.

Run as a program this file is the nursery, as `test_publish_kill` explains.
"""

from __future__ import annotations

import itertools
import sys
from contextlib import suppress

import pytest

from model_store import ConflictError, ModelStore, VersionRetiredError
from tests.faults import test_publish_kill as killing

pytestmark = pytest.mark.kills

BY = {"actor": "writer", "reason": "as often as it can"}
KILLS = 20


def retire_for_ever(store, life):
    """Each life publishes versions of its own and takes all but the last one out of use."""
    for count in itertools.count():
        files = {"weights.safetensors": b"w" * 300_000, "report/tag.txt": b"t"}
        version = store.publish("viper", files, killing.draft_of(f"{life}-{count}")).version
        try:
            store.archive_version("viper", version, **BY)
        except ConflictError:
            continue  # the alias was faster
        killing.acknowledge("ack", version, "archived")
        if count % 3 == 0:
            store.restore_version("viper", version, **BY)
            killing.acknowledge("ack", version, "published")
        elif count % 3 == 1:
            store.delete_version("viper", version, **BY)
            killing.acknowledge("ack", version, "deleted")


@killing.needs_fork
def test_one_who_retires_and_is_killed_at_any_moment_leaves_whole_states(tmp_path, monkeypatch):
    store = ModelStore.open(tmp_path)
    store.publish("viper", {"weights.safetensors": b"w"}, killing.draft_of("first"))
    store.move_alias("viper", "champion", 1, **BY)
    monkeypatch.setattr(killing, "__file__", __file__)
    slaughter = killing.Slaughter("retire", tmp_path)

    def look():
        newest = store.versions("viper")[-1]
        with suppress(ConflictError, VersionRetiredError):  # the other one was faster
            store.move_alias("viper", "champion", newest, **BY)
        named = store.alias("viper", "champion").version
        store.require_usable("viper", named)
        store.verify("viper", named)

    with killing.Reader(look) as reader:
        slaughter.run(KILLS)
    reader.saw_nothing_wrong()

    acknowledged = dict(slaughter.acknowledged)  # the last word of each version
    assert acknowledged, "no writer ever lived long enough"
    following = {"archived": {"archived", "published", "deleted"}, "published": {"published"}, "deleted": {"deleted"}}
    for version, state in acknowledged.items():
        assert store.version_state("viper", version)[0] in following[state]
    for version, retired in store.retired("viper").items():
        if retired.state == "deleted":
            store.delete_version("viper", version, **BY)
            assert not (tmp_path / f"models/viper/versions/{version}/weights.safetensors").exists()
            assert store.manifest("viper", version).version == version
        else:
            store.verify("viper", version)
    assert store.publish("viper", {"weights.safetensors": b"w"}, killing.draft_of("after")).version > max(acknowledged)


if __name__ == "__main__":
    killing.WRITERS["retire"] = retire_for_ever
    killing.nursery(*sys.argv[1:])
