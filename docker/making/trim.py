"""Takes out of an environment what a running service never opens: `trim.py SITE_PACKAGES [serving]`.

Headers, sources, test suites, and the parts of pyarrow that reach other machines. The build then imports what is left.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

UNUSED = (
    # PyTorch: C++ headers, build files and test programs
    "torch/include",
    "torch/share",
    "torch/bin/*",
    # pyarrow: Flight (RPC), stores of its own (ours is obstore), other file formats, copies of one library
    "pyarrow/include",
    "pyarrow/src",
    "pyarrow/tests",
    "pyarrow/includes",
    "pyarrow/*flight*",
    "pyarrow/libarrow_s3.so*",
    "pyarrow/_s3fs.*.so",
    "pyarrow/_gcsfs.*.so",
    "pyarrow/_azurefs.*.so",
    "pyarrow/_hdfs.*.so",
    "pyarrow/*orc.*.so",
    "pyarrow/_pyarrow_cpp_tests.*",
    "pyarrow/libarrow_python*.so",
    "pyarrow/libarrow_python*.so.*.*.*",
    # the way to zstd that is taken where there is no compiled module; here there is one
    "zstandard/_cffi.*.so",
    "numpy/distutils",
    "numpy/_core/include",
    "numpy/_core/lib",
    "sqlalchemy/testing",
    "sqlalchemy/dialects/m[sy]*sql",
    "sqlalchemy/dialects/oracle",
    # what only compilers and editors read
    "**/*.py[xi]",
    "**/*.px[di]",
    "**/*.[hc]",
)
ONLY_FOR_TRAINING = ("numpy/f2py",)  # SciPy imports it
KEPT = ("torch/bin/torch_shm_manager",)
# test suites inside packages; those of SciPy and Matplotlib are asked for by nothing
TEST_SUITES = (
    "numpy/**/tests",
    "scipy/**/tests",
    "mpmath/tests",
    "networkx/**/tests",
    "sympy/**/tests",
    "greenlet/tests",
)


def trim(packages: Path, *, serving: bool = False) -> int:
    """Delete it, and the byte code of what is gone; how many bytes that were."""
    unused = (*UNUSED, *TEST_SUITES, *(ONLY_FOR_TRAINING if serving else ()))
    kept = {packages / each for each in KEPT}
    found = {each for pattern in unused for each in packages.glob(pattern)} - kept
    bytes_of = 0
    for each in sorted(found):
        if each.is_dir() and not each.is_symlink():
            bytes_of += sum(file.lstat().st_size for file in each.rglob("*") if file.is_file())
            shutil.rmtree(each)
        elif each.exists() or each.is_symlink():
            bytes_of += each.lstat().st_size
            each.unlink()
    return bytes_of


if __name__ == "__main__":
    taken = trim(Path(sys.argv[1]), serving="serving" in sys.argv)
    print(f"{taken / 1e6:.0f} MB taken out")
