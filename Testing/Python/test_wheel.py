"""The wheel: its tag, what it contains and needs, and that it works in a fresh environment."""

import os
import pathlib
import re
import subprocess
import sys
import sysconfig
import zipfile

import pytest

SOURCE = pathlib.Path(os.environ["PALPATE_SOURCE"])
# Every Linux system of the platform has these libraries.
OF_THE_SYSTEM = re.compile(r"lib(c|m|stdc\+\+|gcc_s|pthread|dl|rt)\.so\.\d+|ld-linux-.*")


def run(*arguments, **options):
    result = subprocess.run(
        [str(a) for a in arguments], capture_output=True, text=True, timeout=1500, **options
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def fresh_environment(folder):
    """A virtual environment that sees Debian's packages, with its Python."""
    run(sys.executable, "-m", "venv", "--system-site-packages", folder)
    return folder / "bin" / "python"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Built by pip without network, from a copy: setuptools writes into the source folder."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    for name in ("pyproject.toml", "setup.py", "LICENSE", "Docs"):
        (source / name).symlink_to(SOURCE / name)
    python = fresh_environment(folder / "builder")
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    run(
        *(python, "-m", "pip", "wheel", "--no-build-isolation", "--no-deps", "--no-index"),
        *("--wheel-dir", folder, source),
        env=environment,
    )
    (result,) = folder.glob("*.whl")
    return result


def test_the_tag(wheel):
    version = f"cp{sys.version_info.major}{sys.version_info.minor}"
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    assert wheel.name == f"palpate-0.1.0-{version}-{version}-{platform}.whl"


def test_the_content(wheel, tmp_path):
    zipfile.ZipFile(wheel).extractall(tmp_path)
    package = tmp_path / "palpate"
    names = {path.name for path in package.iterdir()}
    assert {"__init__.py", "_palpate.pyi", "_report.html", "py.typed", "LICENSE"} <= names
    files = {p.name for p in (SOURCE / "Source/Adapters/Python/palpate").glob("*.py*")}
    assert files - {"__pycache__"} <= names
    libraries = [path for path in package.iterdir() if ".so" in path.name]
    assert any(path.name.startswith("_palpate") for path in libraries)
    sizes = sorted(path.stat().st_size for path in libraries)
    assert len(set(sizes)) == len(sizes), "a library is there twice"
    for library in libraries:
        dynamic = run("readelf", "-d", library)
        for needed in re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic):
            assert needed in names or OF_THE_SYSTEM.fullmatch(needed), f"{library.name}: {needed}"
        if library.name.startswith(("_palpate", "libPalpate")):
            assert re.findall(r"\((?:RUNPATH|RPATH)\).*\[(.*)\]", dynamic) in (["$ORIGIN"], [])
    needs = (tmp_path / "palpate-0.1.0.dist-info" / "METADATA").read_text()
    commands = (tmp_path / "palpate-0.1.0.dist-info" / "entry_points.txt").read_text()
    assert "palpate-check = palpate.check:main" in commands
    required = [line for line in re.findall(r"Requires-Dist: (.*)", needs) if "extra" not in line]
    assert [re.match(r"\w+", line)[0] for line in required] == ["numpy"]


def test_it_works_in_a_fresh_environment(wheel, tmp_path):
    python = fresh_environment(tmp_path / "user")
    hidden = ("PYTHONPATH", "LD_LIBRARY_PATH")
    environment = {k: v for k, v in os.environ.items() if k not in hidden}
    run(python, "-m", "pip", "install", "--no-index", "--no-deps", wheel, env=environment)
    hello = run(python, SOURCE / "Examples" / "Python" / "hello.py", cwd=tmp_path, env=environment)
    assert "vertex 0 meets triangle 0" in hello
    run(tmp_path / "user" / "bin" / "palpate-check", "--help", env=environment)
    code = """
import palpate, pathlib
here = pathlib.Path(palpate.__file__).parent
maps = open("/proc/self/maps").read()
used = {line.split()[-1] for line in maps.splitlines() if "/" in line}
ours = {p for p in used if "palpate" in p.lower() or "gmp" in p or "hwy" in p or "meshopt" in p}
assert all(pathlib.Path(p).parent == here for p in ours), ours
print(len(ours))
"""
    assert int(run(python, "-c", code, cwd=tmp_path, env=environment)) >= 2
