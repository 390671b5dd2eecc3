"""The script of docs/fmu.md, as it stands there."""

from __future__ import annotations

import re
from pathlib import Path

from service.fmu import Fmi, fmu_bytes

PAGE = Path(__file__).parents[2] / "docs" / "fmu.md"


def test_the_fmpy_script_drives_a_rover(twin, tmp_path, monkeypatch, capsys):
    script = re.search(r"## FMPy.*?```python\n(.*?)```", PAGE.read_text(), re.DOTALL).group(1)
    assert len([line for line in script.splitlines() if line.strip()]) < 15
    (tmp_path / "viper.fmu").write_bytes(fmu_bytes(twin, Fmi.TWO))
    monkeypatch.chdir(tmp_path)
    exec(compile(script, str(PAGE), "exec"), {})
    said = capsys.readouterr().out
    assert 2.0 < float(re.search(r"it is at (\d+\.\d+) m", said).group(1)) < 12.0
