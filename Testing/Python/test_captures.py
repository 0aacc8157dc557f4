"""Captures, replays and audits."""

import numpy as np
import pytest

import palpate
from scenes import Balls, Cut


def test_a_capture_replays_a_frame(tmp_path):
    scene = Cut()
    data = scene.detect()
    palpate.capture(scene.collisions, tmp_path / "frame.txt")
    problem = palpate.read_capture(tmp_path / "frame.txt")
    replay = palpate.set_up(problem)
    replay.detect_collision()
    assert replay.collision_data(0, 1) == data
    palpate.write_capture(problem, str(tmp_path / "again.txt"))
    assert (tmp_path / "again.txt").read_text() == (tmp_path / "frame.txt").read_text()
    with pytest.raises(palpate.Error) as caught:
        palpate.read_capture(tmp_path / "missing.txt")
    assert caught.value.code is palpate.ErrorCode.FILE and "missing.txt" in str(caught.value)


def test_problems_show_everything():
    scene = Cut()
    scene.detect()
    capsule = palpate.Capsule((0, 0, 0), (0, 0, 1), 0.5)
    shape = scene.collisions.add_analytical_geometry(capsule)
    problem = scene.collisions.problem()
    blade = problem.geometries[scene.blade]
    assert blade.id == scene.blade and np.allclose(blade.before - blade.now, [0, 0, 4])
    assert blade.type is palpate.GeometryType.TRIANGLES and blade.triangles.tolist() == [[0, 1, 2]]
    assert blade.field is None and blade.proxy is None and blade.analytical is None
    assert problem.geometries[shape].analytical == capsule
    assert problem.geometries[shape].motion == palpate.RigidMotion()
    pair = problem.pairs[0]
    assert (pair.a, pair.b, pair.predicate) == (0, 1, False)
    assert pair.settings.thickness == 0.5 and pair.method is palpate.Method.CONTINUOUS
    assert problem.settings == palpate.Settings()


def test_the_audit_finds_nothing(tmp_path):
    scene = Balls(audit=palpate.AuditSettings(features=50, folder=tmp_path))
    for number in range(3):
        scene.step(10 * number)
        assert scene.collisions.audit_failures() == []
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(palpate.Error) as caught:
        palpate.OctreeBasedCD(audit=palpate.AuditSettings(features=1, folder="/no/such/folder"))
    assert caught.value.code is palpate.ErrorCode.INVALID_SETTINGS
