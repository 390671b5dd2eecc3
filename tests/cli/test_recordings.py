"""`datasets validate`, `upload` and `import`: options that say how runs were recorded."""

from __future__ import annotations

import re

import pytest

from service.cli.failures import ExitCode
from tests.cli.conftest import call
from tests.datasets.recordings import PLAIN, archive, run_columns, settling, shipped, text, world

OPTIONS = ("--frame", "world", "--start", "2")


@pytest.fixture
def run():
    return next(each for each in shipped().values() if each.name.endswith("viper_s28_m430_t60_h10"))


def test_validate_names_the_options_and_import_and_upload_take_them(run, tmp_path):
    own = run_columns(run, PLAIN, 20)
    columns = settling(world(own, run.slope_deg), 2.0, drop_m=0.0)
    folder, file, store = tmp_path / "runs", tmp_path / "runs.tar", tmp_path / "store"
    folder.mkdir()
    (folder / "run.csv").write_bytes(text(columns))
    (folder / "runs.csv").write_text("file,slope_deg,mass_kg,torque_nm\nrun.csv,28,430,60\n")
    file.write_bytes(archive(run, columns).data)
    told = call("datasets", "validate", folder, "--json")
    assert told.code == ExitCode.REFUSED
    assert re.search("--frame world", told.out)
    assert re.search("--start 2 ", call("datasets", "validate", folder, "--json", "--frame", "world").out)
    assert call("datasets", "validate", folder, *OPTIONS).code == 0
    imported = call("datasets", "import", folder, "--name", "a", "--store", store, "--json", *OPTIONS)
    uploaded = call("datasets", "upload", file, "--name", "a", "--store", store, "--json", *OPTIONS)
    assert imported.json["dataset"]["id"] == uploaded.json["id"]
    exported = tmp_path / "out"
    assert call("datasets", "export", "a", exported, "--store", store).code == 0
    again = call("datasets", "import", exported, "--name", "b", "--store", store, "--json")
    assert again.json["dataset"]["id"] == uploaded.json["id"]


@pytest.mark.parametrize("option", ["--frame", "--reference", "--start"])
@pytest.mark.parametrize("command", ["validate", "import", "upload"])
def test_a_word_that_is_none_is_wrong_usage(command, option, tmp_path):
    words = ("--name", "a") if command == "import" else ()
    answer = call("datasets", command, tmp_path, *words, option, "nonsense")
    assert answer.code == ExitCode.USAGE
    assert "nonsense" in answer.error
    assert "allowed" in answer.error
