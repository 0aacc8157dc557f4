"""palpate-check finds each known fault in its frame with its elements, and nothing else."""

import csv
import json
import os
import re
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest

import palpate
import sequences
from palpate import _replay, check
from palpate._exact import orientations
from palpate._findings import Checker
from palpate._replay import DIGITS, digits_of
from palpate._sequence import find_sequence
from scenes import ball
from sequences import grid, made, write

sys.path.append(os.path.join(os.environ["PALPATE_SOURCE"], "Testing", "Common"))
import browser  # noqa: E402
import report  # noqa: E402


def run(folder, output, *options):
    """The exit code and the rows of findings.csv."""
    code = check.main([str(folder), "--output", str(output), "--quiet", *map(str, options)])
    with open(output / "findings.csv", newline="") as file:
        return code, list(csv.DictReader(file))


def frames_of(rows, kind):
    return {int(row["frame"]) for row in rows if row["kind"] == kind}


def elements_of(rows, body):
    sides = [(row["body_a"], row["element_a"]) for row in rows]
    sides += [(row["body_b"], row["element_b"]) for row in rows]
    return {element for name, element in sides if name == body}


def replays(path):
    """Whether the frame of a capture has contacts; the number of its elements."""
    problem = palpate.read_capture(path)
    collisions = palpate.set_up(problem)
    collisions.detect_collision()
    data = [collisions.collision_data(pair.a, pair.b) for pair in problem.pairs]
    lists = ("vertex_triangle", "triangle_vertex", "edge_edge", "intersecting_triangles")
    found = any(len(getattr(d, name)) for d in data for name in lists)
    return found, sum(len(geometry.triangles) for geometry in problem.geometries)


@pytest.mark.parametrize("suffix", [".vtp", ".vtk", ".obj", ".ply"])
def test_a_membrane_pierced_between_two_frames(tmp_path, suffix):
    folder = made(sequences.pierced_membrane, tmp_path, suffix)
    code, rows = run(folder, tmp_path / "out", "--svg")
    assert code == 1
    assert {row["kind"] for row in rows} == {"crossing"} and frames_of(rows, "crossing") == {6}
    assert elements_of(rows, "membrane") == {"triangle 3"}
    assert elements_of(rows, "blade") == {"vertex 0", "vertex 1", "vertex 2"}
    times = {row["element_a"]: float(row["time_of_impact"]) for row in rows}
    assert times["vertex 0"] == pytest.approx(1.2 / 3, abs=2e-6)
    (path,) = (tmp_path / "out" / "captures").iterdir()
    assert replays(path) == (True, 2)


@pytest.mark.parametrize("radius", [0, 0.2])
def test_a_thread_pulled_through_itself(tmp_path, radius):
    folder = made(sequences.thread_through_itself, tmp_path)
    (tmp_path / "bodies.toml").write_text(
        f'[bodies.thread]\nfiles = "thread.npz"\nradius = {radius}\n'
    )
    code, rows = run(folder, tmp_path / "out", "--bodies", tmp_path / "bodies.toml", "--svg")
    assert code == 1
    crossings = [row for row in rows if row["kind"] == "self-crossing"]
    assert frames_of(rows, "self-crossing") == {4}
    assert ("edge 2 3", "edge 6 7") in {(row["element_a"], row["element_b"]) for row in crossings}
    early = 0.5 - 0.4 if radius else 0.5
    assert min(float(row["time_of_impact"]) for row in crossings) == pytest.approx(early, abs=1e-5)
    assert {row["kind"] for row in rows} == {"self-crossing"}
    (path,) = (tmp_path / "out" / "captures").iterdir()
    assert replays(path) == (True, 2)


def test_a_cloth_that_tears_into_a_body(tmp_path):
    folder = made(sequences.cloth_that_tears, tmp_path)
    code, rows = run(folder, tmp_path / "out", "--svg")
    assert code == 1
    assert frames_of(rows, "topology") == {3}
    (change,) = (row for row in rows if row["kind"] == "topology")
    assert change["body_a"] == "cloth" and change["text"].startswith("from 81 vertices")
    assert frames_of(rows, "penetration") == {3, 4, 5}
    inside = [row for row in rows if row["text"] == "inside"]
    assert elements_of(inside, "cloth") == {"vertex 85"}
    # The triangles of the flap's end, and no others, pierce the ball.
    torn = palpate.read_mesh_file(folder / "cloth0003.ply").triangles
    flap = {f"triangle {t}" for t in np.flatnonzero((torn == 85).any(axis=1))}
    piercing = [row for row in rows if row["kind"] == "penetration" and row not in inside]
    assert elements_of(piercing, "cloth") == flap
    assert not frames_of(rows, "self-intersection") and not frames_of(rows, "self-crossing")
    assert all(replays(path)[0] for path in (tmp_path / "out" / "captures").iterdir())


def test_a_clean_sequence(tmp_path, capsys):
    folder = made(sequences.falling_ball, tmp_path)
    assert check.main([str(folder), "--output", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    assert "6 frames, bodies: ball, floor" in text and "nothing found" in text
    assert 'body "floor" has one file' in text
    assert (tmp_path / "out" / "findings.csv").read_text().count("\n") == 1


def test_inverted_tetrahedra(tmp_path):
    folder = made(sequences.inverted_tetrahedron, tmp_path)
    code, rows = run(folder, tmp_path / "out", "--svg")
    assert code == 1 and frames_of(rows, "inverted") == {2, 3}
    inverted = [row for row in rows if row["kind"] == "inverted"]
    assert elements_of(inverted, "organ") == {"tetrahedron 1"}


def test_a_body_inside_another_and_one_through_itself(tmp_path):
    small, triangles = ball(6, radius=0.3)
    sheet = np.array([[0, 0, 5], [4, 0, 5], [0, 4, 5], [1, 1, 6], [1, 1, 4], [9, 1, 5]], float)
    arrays = {"out.positions": ball(10)[0], "out.triangles": ball(10)[1]}
    arrays |= {"in.positions": np.stack([small, small + 0.1]), "in.triangles": triangles}
    arrays |= {"sheet.positions": sheet, "sheet.triangles": [[0, 1, 2], [3, 4, 5]]}
    (tmp_path / "in").mkdir()
    np.savez_compressed(tmp_path / "in" / "scene.npz", **arrays)
    code, rows = run(tmp_path / "in", tmp_path / "out", "--svg")
    assert code == 1
    penetrations = [row for row in rows if row["kind"] == "penetration"]
    assert frames_of(rows, "penetration") == {0, 1} and len(penetrations) == 2 * len(small)
    assert all(row["text"] == "inside" and float(row["depth"]) > 0.3 for row in penetrations)
    (own,) = (row for row in rows if row["kind"] == "self-intersection")
    assert (own["element_a"], own["element_b"]) == ("triangle 0", "triangle 1")
    assert len(rows) == len(penetrations) + 1


def test_surfaces_that_touch_are_no_fault(tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    positions, triangles = grid(2)
    for frame in range(3):
        write(folder / f"upper_{frame}.obj", positions + [0, 0, max(0, 1 - frame)], triangles)
    write(folder / "lower.obj", *grid(3))
    code, rows = run(folder, tmp_path / "out")
    assert code == 0 and {row["kind"] for row in rows} == {"touch"}
    assert frames_of(rows, "touch") == {1, 2}
    assert run(folder, tmp_path / "out", "--touch")[0] == 1


def test_a_box_that_rests_on_another_is_no_fault(tmp_path):
    """In frame 0 it is above, in frame 1 it rests, and in frame 2 it is 0.125 deep."""
    folder = tmp_path / "in"
    folder.mkdir()
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = palpate.triangles_of_quads(quads)
    write(folder / "lower.obj", 4 * corners, triangles)
    for frame, height in enumerate((4.5, 4.0, 3.875)):
        write(folder / f"upper_{frame}.obj", corners + [1.25, 1.5, height], triangles)
    code, rows = run(folder, tmp_path / "out")
    assert code == 1 and frames_of(rows, "penetration") == {2}
    assert 1 in frames_of(rows, "touch")
    depths = {float(row["depth"]) for row in rows if row["text"] == "inside"}
    assert depths == {0.125}


def test_wrong_frames_are_reported_and_the_others_checked(tmp_path):
    folder = made(sequences.pierced_membrane, tmp_path)
    (folder / "membrane_01.vtp").unlink()
    (folder / "membrane_03.vtp").write_text("")
    (folder / "settings.json").write_text("{}")
    code, rows = run(folder, tmp_path / "out", "--svg")
    assert code == 2 and frames_of(rows, "crossing") == {6}
    report = (tmp_path / "out" / "report.txt").read_text()
    assert "note: files of other formats are not read: .json\n" in report
    texts = {int(row["frame"]): row["text"] for row in rows if row["kind"] == "unreadable"}
    assert set(texts) == {1, 3}
    assert texts[1] == 'frame 1, body "membrane": there is no file'
    assert texts[3].startswith('frame 3, body "membrane": ') and "membrane_03.vtp" in texts[3]
    for name in ("blade_02.vtp", "membrane_02.vtp"):
        (folder / name).unlink()
    _, rows = run(folder, tmp_path / "out", "--svg")
    assert {r["body_a"] for r in rows if r["frame"] == "2"} == {"blade", "membrane"}


def test_wrong_arrays_name_their_element(tmp_path, capsys):
    positions = np.zeros((3, 4, 3))
    positions[1, 2, 0] = np.nan
    np.savez(tmp_path / "cloth.npz", positions=positions, triangles=[[0, 1, 7]])
    code, rows = run(tmp_path, tmp_path / "out")
    texts = [row["text"] for row in rows]
    assert code == 2 and len(rows) == 3
    assert "triangle 0: vertex index 7" in texts[0] and 'frame 0, body "cloth"' in texts[0]
    assert "cloth.npz: the position of vertex 2 is not finite" in texts[1]
    np.savez(tmp_path / "cloth.npz", positions=positions[:0], triangles=[[0, 1, 2]])
    assert check.main([str(tmp_path), "--quiet"]) == 2
    assert 'body "cloth": the positions have no frames' in capsys.readouterr().err
    with open(tmp_path / "cloth.npz", "r+b") as file:
        file.truncate(100)
    assert check.main([str(tmp_path), "--quiet"]) == 2


def test_wrong_commands(tmp_path, capsys):
    folder = made(sequences.pierced_membrane, tmp_path)
    toml = tmp_path / "bodies.toml"
    toml.write_text('[bodies.a]\nfiles = "blade_*.vtp"\nradios = 2\n')
    for arguments, text in (
        ([tmp_path / "none"], "no such folder"),
        ([tmp_path], "no frames"),
        ([folder, "--bodies", toml], 'body "a": no option "radios"'),
        ([folder, "--body", "a=tool_*.vtp"], 'body "a": no file'),
        ([folder, "--pair", "blade,liver"], 'the pairs name the body "liver"'),
    ):
        assert check.main([str(a) for a in arguments]) == 2
        assert text in capsys.readouterr().err


def test_series_of_paraview(tmp_path):
    folder = made(sequences.pierced_membrane, tmp_path)
    (folder / "data").mkdir()
    for file in folder.glob("*.vtp"):
        file.rename(folder / "data" / file.name)
    data = "".join(
        f'<DataSet timestep="{frame / 100}" part="{part}" file="data/{name}_{frame:02}.vtp"/>'
        for frame in range(8)
        for part, name in enumerate(("blade", "membrane"))
    )
    pvd = f'<VTKFile type="Collection"><Collection>{data}</Collection></VTKFile>'
    (folder / "run.pvd").write_text(pvd)
    code, rows = run(folder, tmp_path / "out", "--svg")
    assert code == 1 and {row["time"] for row in rows} == {"0.06"}
    assert elements_of(rows, "run.1") == {"triangle 3"}
    (folder / "run.pvd").unlink()
    for name in ("blade", "membrane"):
        files = [
            {"name": f"data/{name}_{frame:02}.vtp", "time": frame / 50} for frame in range(8)
        ]
        (folder / f"{name}.vtp.series").write_text(json.dumps({"files": files}))
    code, rows = run(folder, tmp_path / "out", "--svg")
    assert code == 1 and {row["time"] for row in rows} == {"0.12"}
    assert elements_of(rows, "membrane") == {"triangle 3"}
    for path in folder.glob("*.series"):
        path.unlink()
    for frame in range(8):
        blocks = "".join(
            f'<DataSet index="{i}" name="{name}" file="data/{name}_{frame:02}.vtp"/>'
            for i, name in enumerate(("blade", "membrane"))
        )
        (folder / f"scene{frame}.vtm").write_text(
            f'<VTKFile type="vtkMultiBlockDataSet"><vtkMultiBlockDataSet>{blocks}'
            "</vtkMultiBlockDataSet></VTKFile>"
        )
    files = [{"name": f"scene{frame}.vtm", "time": frame} for frame in range(8)]
    (folder / "scene.vtm.series").write_text(json.dumps({"files": files}))
    code, rows = run(folder, tmp_path / "out", "--svg")
    assert code == 1 and {row["time"] for row in rows} == {"6.0"}
    assert elements_of(rows, "membrane") == {"triangle 3"}


def test_the_page_needs_nothing_else(tmp_path):
    folder = made(sequences.pierced_membrane, tmp_path)
    run(folder, tmp_path / "out", "--svg")
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("<svg") == 1 and "<polygon" in page
    assert set(re.findall(r"https?://[^\"]*", page)) == {"http://www.w3.org/2000/svg"}
    link = re.search(r'href="(captures[^"]+)"', page)[1]
    assert (tmp_path / "out" / link).is_file()


def data_of(page):
    return json.loads(re.search(r'id="data">(.*?)</script>', page.read_text(), re.DOTALL)[1])


def test_numbers_of_the_page():
    for values in ([], [0], [91, 0], [92, 5], [8463, 1], [8464], [92**3, 92**4 - 1]):
        width, *digits = (DIGITS.tolist().index(ord(c)) for c in digits_of(values))
        numbers = np.array(digits, int).reshape(-1, width) @ 92 ** np.arange(width - 1, -1, -1)
        assert numbers.tolist() == values and not set('"<\\') & set(digits_of(values))


@pytest.mark.skipif(browser.PROGRAM is None, reason="chromium is not installed")
@pytest.mark.parametrize("name", ["pierced_membrane", "thread_through_itself", "cloth_that_tears"])
def test_the_page_in_a_browser(name, tmp_path):
    folder = made(getattr(sequences, name), tmp_path)
    run(folder, tmp_path / "out", "--svg")
    assert report.check(tmp_path / "out" / "report.html") == []


def test_the_page_of_a_clean_sequence(tmp_path):
    run(made(sequences.falling_ball, tmp_path), tmp_path / "out")
    data = data_of(tmp_path / "out" / "report.html")
    assert data["series"] == [] and [f["at"] for f in data["replay"]["frames"]] == [*range(6)]


def test_a_long_sequence_has_its_worst_frames_in_the_page(tmp_path, monkeypatch):
    monkeypatch.setattr(_replay, "MOST_FRAMES", 3)
    folder = made(sequences.pierced_membrane, tmp_path)
    run(folder, tmp_path / "out", "--svg")
    frames = [f["at"] for f in data_of(tmp_path / "out" / "report.html")["replay"]["frames"]]
    assert len(frames) == 3 and 6 in frames
    monkeypatch.setattr(_replay, "MOST_BYTES", 100)
    run(folder, tmp_path / "out", "--svg")
    data = data_of(tmp_path / "out" / "report.html")
    assert "replay" not in data and "too large" in data["paragraphs"][-1]


def test_pictures_by_vtk(tmp_path):
    pytest.importorskip("vtkmodules")
    folder = made(sequences.pierced_membrane, tmp_path)
    run(folder, tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 1 and len(page) > 10_000


def test_answers_do_not_depend_on_where_the_check_starts(tmp_path):
    for make in (sequences.cloth_that_tears, sequences.inverted_tetrahedron):
        sequence = find_sequence(made(make, tmp_path), {}, [])
        frames = len(sequence.numbers)
        whole = [repr(found) for found in Checker(sequence).check(0, frames)]
        assert sum(len(text) for text in whole) > 2 * frames
        for first in range(frames):
            (found,) = Checker(sequence, threads=1).check(first, first + 1)
            assert repr(found) == whole[first]


def test_memory_does_not_grow_with_the_frames(tmp_path):
    positions, triangles = ball(24)
    peaks = []
    for frames in (4, 40):
        folder = tmp_path / str(frames)
        folder.mkdir()
        moving = positions + np.linspace(0, 1, frames)[:, None, None]
        np.savez(folder / "ball.npz", positions=moving, triangles=triangles)
        del moving
        sequence = find_sequence(folder, {}, [])
        tracemalloc.start()
        assert list(Checker(sequence).check(0, frames)) == frames * [[]]
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


def test_exact_signs():
    random = np.random.default_rng(7)
    corners = random.integers(-3, 4, size=(4, 2000, 3)).astype(float)
    volumes = np.linalg.det(np.stack([corners[i] - corners[0] for i in (1, 2, 3)], axis=1))
    signs = orientations(*corners)
    assert (signs == np.sign(np.round(volumes))).all() and (signs == 0).sum() > 50
    # The sum of the corners' coordinates rounds, but the point lies beside the plane.
    tiny = np.array([[0.1, 0.2, 0.3 + k * 2.0**-54] for k in (0, 1, 2)])
    plane = np.array([[[0.1, 0.2, 0.3]], [[1e3, 0.2, 0.3]], [[0.1, 1e3, 0.3]]])
    signs = orientations(*np.repeat(plane, 3, axis=1), tiny)
    assert signs.tolist() == np.sign(tiny[:, 2] - 0.3).tolist() and signs[0] == 0


def pierce(a, b):
    """Whether triangles (n, 3, 3) pierce each other, each by itself."""
    collisions = palpate.OctreeBasedCD()
    corners = np.arange(3 * len(a)).reshape(-1, 3)
    first, second = (collisions.add_triangle_mesh(x.reshape(-1, 3), corners) for x in (a, b))
    rows = np.arange(len(a))
    return collisions.queries().pierce(first, second, np.stack([rows, rows], axis=1))


def test_piercing_is_more_than_touching():
    random = np.random.default_rng(8)
    a, b = random.integers(-2, 3, size=(2, 1000, 3, 3)).astype(float)
    piercing = pierce(a, b)
    intersecting = palpate.triangles_intersect(*a.transpose(1, 0, 2), *b.transpose(1, 0, 2))
    assert not (piercing & ~intersecting).any()
    assert 200 < piercing.sum() < intersecting.sum() - 50
    assert (pierce(b, a) == piercing).all()
    for order in ([1, 2, 0], [1, 0, 2]):
        assert (pierce(a[:, order], b) == piercing).all()
    # Without a flat tetrahedron among the corners, nothing touches without piercing.
    a, b = random.normal(size=(2, 4000, 3, 3))
    intersecting = palpate.triangles_intersect(*a.transpose(1, 0, 2), *b.transpose(1, 0, 2))
    assert (pierce(a, b) == intersecting).all() and intersecting.sum() > 300
    queries = palpate.OctreeBasedCD().queries()
    with pytest.raises(palpate.Error, match="never added"):
        queries.pierce(0, 1, [[0, 0]])


def test_piercing_refuses_what_has_no_such_triangles():
    collisions = palpate.OctreeBasedCD()
    corners = np.eye(3)
    mesh = collisions.add_triangle_mesh(corners, [[0, 1, 2]])
    points = collisions.add_point_set(corners)
    shape = collisions.add_analytical_geometry(palpate.Sphere())
    queries = collisions.queries()
    with pytest.raises(palpate.Error, match="geometry 0 has no element 1"):
        queries.pierce(mesh, mesh, [[0, 0], [0, 1]])
    with pytest.raises(palpate.Error, match="geometry 1 has points"):
        queries.pierce(mesh, points, [[0, 0]])
    with pytest.raises(palpate.Error, match="geometry 2 is a shape"):
        queries.pierce(shape, mesh, [[0, 0]])
    assert queries.pierce(mesh, mesh, np.empty((0, 2), dtype=int)).shape == (0,)


def box(low, high):
    corners = [[(low, high)[v >> axis & 1][axis] for axis in range(3)] for v in range(8)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    triangles = [half for a, b, c, d in faces for half in ((a, b, c), (a, c, d))]
    return np.array(corners, dtype=float), np.array(triangles)


def test_a_box_that_slides_over_the_edge_of_its_table_only_touches(tmp_path):
    table, triangles = box((-2, -2, -2), (2, 2, 0))
    resting, _ = box((-1, -1, 0), (1, 1, 1))
    ways = np.arange(0, 2.5, 0.25)[:, None, None] * [1, 0.5, 0]
    for depth in (0, 0.25):
        folder = tmp_path / str(depth)
        folder.mkdir()
        np.savez(folder / "table.npz", positions=table, triangles=triangles)
        moving = resting + ways - [0, 0, depth]
        np.savez(folder / "box.npz", positions=moving, triangles=triangles)
        code, rows = run(folder, tmp_path / "out")
        kinds = {row["kind"] for row in rows} - {"touch"}
        assert (code, kinds) == ((1, {"penetration"}) if depth else (0, set()))


def test_the_command_explains_itself():
    text = subprocess.run(
        [sys.executable, "-m", "palpate.check", "--help"], capture_output=True, text=True
    ).stdout
    for part in ("exit status", "--workers", "findings.csv", "examples:", "topology"):
        assert part in text
