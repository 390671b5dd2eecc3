"""`python -m tests.other_clients [NAME ...]`: installs clients, runs the examples of docs/clients.md, prints a table.

Each environment of `requirements/` is made once, in `.other-clients/` of the checkout. `--write` puts what the examples
print into the page. Ends with 1 if one prints something else than the page shows.
"""

from __future__ import annotations

import argparse
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.request import urlopen

from tests.other_clients.page import ADDRESS, Example, examples, show

ROOT = Path(__file__).parents[2]
REQUIREMENTS = Path(__file__).parent / "requirements"
ENVIRONMENTS = ROOT / ".other-clients"
_INSTALL_S, _START_S = 900, 120


def main() -> int:
    """Run those whose environment is named, or all of them."""
    known = sorted(file.stem for file in REQUIREMENTS.iterdir())
    parser = argparse.ArgumentParser(description="Run the examples of docs/clients.md.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"environments, of {', '.join(known)}")
    parser.add_argument("--write", action="store_true", help="write what they print into the page")
    asked = parser.parse_args()
    if strangers := set(asked.names) - set(known):
        parser.error(f"there is no {', '.join(sorted(strangers))}")
    wanted = [each for each in examples() if not asked.names or each.environment in asked.names]
    printed: dict[Example, str] = {}
    with serving() as address:
        for name in dict.fromkeys(each.environment for each in wanted):
            with tempfile.TemporaryDirectory() as folder:
                programs = environment(name, Path(folder))
                for each in wanted:
                    if each.environment == name:
                        found = each.prints(address, programs, Path(folder)) if programs else "not installed\n"
                        printed[each] = found.replace(address, ADDRESS)
                        report(each, printed[each])
    if asked.write:
        show([printed.get(each, each.shown) for each in examples()])
    wrong = sum(each.shown != printed[each] for each in wanted)
    print(f"{len(wanted) - wrong} passed, {wrong} failed")
    return 1 if wrong and not asked.write else 0


def report(example: Example, printed: str) -> None:
    """A line of the table; what was printed where the page shows something else."""
    good = printed == example.shown
    print(f"{example.environment:24}{example.language:8}{'as shown' if good else 'NOT AS SHOWN'}", flush=True)
    if not good:
        print("".join(f"    {line}\n" for line in printed.splitlines()[-15:]), flush=True)


def environment(name: str, folder: Path) -> Path | None:
    """The folder of its programs, installed where it is not there yet; None, with the reason printed, where that fails.

    Packages of npm are put into `folder` itself, where Node looks for them.
    """
    if (packages := REQUIREMENTS / f"{name}.npm").exists():
        if shutil.which("npm") is None:
            print(f"{name}: there is no npm here")
            return None
        command = ["npm", "install", "--silent", "--no-fund", "--no-audit", *packages.read_text().split()]
        return folder / "node_modules/.bin" if installed(name, command, folder) else None
    home = ENVIRONMENTS / name
    file, stamp = REQUIREMENTS / f"{name}.txt", home / "requirements.txt"
    if not stamp.exists() or stamp.read_text() != file.read_text():
        subprocess.run([sys.executable, "-m", "venv", "--clear", str(home)], check=True, timeout=_INSTALL_S)
        pip = [str(home / "bin/python"), "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
        if not installed(name, [*pip, "--requirement", str(file)], folder):
            return None
        shutil.copy(file, stamp)
    return home / "bin"


def installed(name: str, command: list[str], folder: Path) -> bool:
    """Whether the command that installs it ended well."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=_INSTALL_S, check=False)
    if done.returncode:
        print(f"{name} cannot be installed: {(done.stderr or done.stdout).strip()[-500:]}")
    return done.returncode == 0


@contextmanager
def serving() -> Iterator[str]:
    """The service over the shipped models, ready; its host and port."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    variables = {name: value for name, value in os.environ.items() if not name.startswith("ROVER_TWIN_")}
    command = [sys.executable, "-m", "service", "serve", "--port", str(port), "--log-level", "warning"]
    with subprocess.Popen(command, cwd=ROOT, env=variables) as process:
        try:
            wait_ready(f"http://127.0.0.1:{port}/health/ready", process)
            yield f"127.0.0.1:{port}"
        finally:
            process.terminate()


def wait_ready(address: str, process: subprocess.Popen[bytes]) -> None:
    """Raises RuntimeError for a service that does not become ready."""
    ends = time.monotonic() + _START_S
    while time.monotonic() < ends and process.poll() is None:
        try:
            with urlopen(address, timeout=5):
                return
        except OSError:
            time.sleep(0.2)
    raise RuntimeError("the service does not become ready")


if __name__ == "__main__":
    sys.exit(main())
