"""Builds the package by CMake; see pyproject.toml.

The environment variable PALPATE_BUILD names a folder in which CMake has built Palpate with the
same Python. Then nothing is compiled again. PALPATE_CMAKE_ARGS has further options for CMake.
"""

import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import tempfile

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

SOURCE = pathlib.Path(__file__).resolve().parent


class BuildByCMake(build_ext):
    """The extension is the whole package: CMake's component Python."""

    def run(self) -> None:
        if self.inplace:
            sys.exit("An editable install is not possible. Put build/.../Python on PYTHONPATH.")
        with tempfile.TemporaryDirectory() as folder:
            build = os.environ.get("PALPATE_BUILD")
            if build is None:
                build = os.path.join(self.build_temp, "cmake")
                options = [
                    "-DCMAKE_BUILD_TYPE=Release",
                    f"-DPython_EXECUTABLE={sys.executable}",
                    "-DPALPATE_WITH_PYTHON=ON",
                    "-DPALPATE_PRECOMPILED_HEADERS=ON",
                    "-DPALPATE_UNITY=ON",  # with both, compilation takes less than half the time
                ]
                options += [
                    f"-DPALPATE_{part}=OFF"
                    for part in ("WITH_C", "WITH_VTK", "WITH_FCL", "BUILD_TESTING", "BUILD_EXAMPLES")
                ]
                options += shlex.split(os.environ.get("PALPATE_CMAKE_ARGS", ""))
                ninja = ["-G", "Ninja"] if shutil.which("ninja") else []
                subprocess.run(["cmake", "-S", SOURCE, "-B", build, *ninja, *options], check=True)
                jobs = str(os.cpu_count() or 1)
                subprocess.run(
                    ["cmake", "--build", build, "--target", "PalpatePython", "--parallel", jobs],
                    check=True,
                )
            install = ["cmake", "--install", build, "--component", "Python", "--prefix", folder]
            subprocess.run(install, check=True)
            package = pathlib.Path(folder) / "palpate"
            copy_package(package, pathlib.Path(self.build_lib) / "palpate")


def copy_package(package: pathlib.Path, target: pathlib.Path) -> None:
    """Copies files. A wheel has no links: each library comes once, as others name it."""
    target.mkdir(parents=True, exist_ok=True)
    links = {path.resolve() for path in package.iterdir() if path.is_symlink()}
    for path in package.iterdir():
        if path not in links:
            shutil.copyfile(path, target / path.name)


setup(
    packages=[],
    py_modules=[],
    ext_modules=[Extension("palpate._palpate", sources=[])],  # a wheel of this platform
    cmdclass={"build_ext": BuildByCMake},
)
