"""Distance fields, proxies, simplification, welding and defects."""

import numpy as np
import pytest

import palpate
from scenes import TETRAHEDRON, TETRAHEDRON_TRIANGLES, ball


@pytest.fixture(scope="module")
def field():
    return palpate.DistanceField.build(*ball(10), error_bound=0.02, band=0.5)


def test_values(field, tmp_path):
    points = np.random.default_rng(1).uniform(-1, 1, size=(100, 3))
    values = field.values(points)
    collisions = palpate.OctreeBasedCD()
    mesh = collisions.add_triangle_mesh(*ball(10))
    exact = collisions.queries().signed_distances(mesh, points)["distance"]
    near = abs(exact) <= field.band
    assert near.any() and (abs(values - exact)[near] <= field.error_bound).all()
    assert np.array_equal(field.value(points), values)
    assert isinstance(field.value(points[0]), float) and field.value(points[0]) == values[0]
    assert field.gradient(points).shape == (100, 3) and field.gradient(points[0]).shape == (3,)
    assert field.sign_is_reliable(points).all() and field.sign_is_reliable(points[0]) is True
    assert field.is_closed and field.cells > 0 and field.bytes > 0
    field.save(tmp_path / "ball.field")
    again = palpate.DistanceField.load(str(tmp_path / "ball.field"))
    assert np.array_equal(again.values(points), values) and repr(again) == repr(field)
    with pytest.raises(palpate.Error, match="missing.field") as caught:
        palpate.DistanceField.load(tmp_path / "missing.field")
    assert caught.value.code is palpate.ErrorCode.FILE


def test_contacts_with_a_field(field):
    collisions = palpate.OctreeBasedCD()
    body = collisions.add_distance_field(field)
    points = collisions.add_point_set([[1.0, 0, 0], [3, 0, 0]], 0.1)
    collisions.add_collision_pair(points, body, method="distance_field", thickness=0.05)
    collisions.detect_collision()
    data = collisions.collision_data(points, body)
    assert data.shape["id"].tolist() == [0] and data.error_bound == field.error_bound
    assert collisions.problem().geometries[body].field.cells == field.cells
    mesh = collisions.add_triangle_mesh(*ball(10))
    collisions.attach_distance_field(mesh, field)
    collisions.attach_distance_field(mesh, None)


def test_proxies():
    collisions = palpate.OctreeBasedCD()
    particles = collisions.add_point_set([[1.01, 0, 0], [3, 0, 0]], 0.05)
    body = collisions.add_triangle_mesh(*ball(20))
    collisions.add_collision_pair(particles, body, method="proxy", allowed_error=0.01)
    collisions.detect_collision()
    data = collisions.collision_data(particles, body)
    assert data.shape["id"].tolist() == [0] and data.validity.method is palpate.Method.PROXY
    other = collisions.add_triangle_mesh(*ball(20))
    collisions.attach_surface_proxy(other, reach=0.2, error_bound=0.01)
    assert collisions.problem().geometries[other].proxy == palpate.SurfaceProxySettings(
        reach=0.2, error_bound=0.01
    )
    collisions.attach_surface_proxy(other)
    assert collisions.problem().geometries[other].proxy is None


def test_simplify():
    positions, triangles = ball(20)
    try:
        simple = palpate.simplify(positions, triangles, 0.05, threads=1, progress=lambda f: None)
    except palpate.Error as error:
        if error.code is not palpate.ErrorCode.NOT_AVAILABLE:
            raise
        pytest.skip("this build has no simplify()")
    assert len(simple.triangles) < len(triangles) and 0 < simple.distance <= 0.05
    assert palpate.find_mesh_defects(simple.triangles).closed
    collisions = palpate.OctreeBasedCD()
    mesh = collisions.add_triangle_mesh(simple.positions, simple.triangles)
    assert collisions.queries().contains(mesh, positions).all()
    with pytest.raises(palpate.Error) as caught:
        palpate.simplify(positions, triangles, 0.05, progress=lambda fraction: False)
    assert caught.value.code is palpate.ErrorCode.CANCELLED


def test_weld_and_defects():
    positions = TETRAHEDRON[TETRAHEDRON_TRIANGLES].reshape(-1, 3)
    triangles = np.arange(12).reshape(-1, 3)
    assert palpate.find_mesh_defects(triangles).unwelded
    welded = palpate.weld(positions, triangles)
    assert welded.positions.shape == (4, 3) and welded.vertex_of.shape == (12,)
    assert np.array_equal(welded.positions[welded.triangles], positions[triangles])
    defects = palpate.find_mesh_defects(welded.triangles, welded.positions)
    assert defects.closed and not defects.inside_out and len(defects.overlapping) == 0
    assert palpate.find_mesh_defects(welded.triangles[:, ::-1], welded.positions).inside_out
    assert palpate.find_mesh_defects(welded.triangles[1:]).open.shape == (3, 2)
    assert palpate.triangles_of_quads([[0, 1, 2, 3]]).tolist() == [[0, 1, 2], [0, 2, 3]]
