"""Spatial queries: batches equal single queries, and every query answers."""

import numpy as np
import pytest

import palpate
from scenes import BLADE, BLADE_TRIANGLES, TETRAHEDRON, ball, same


@pytest.fixture(scope="module")
def scene():
    class Scene:
        collisions = palpate.OctreeBasedCD()
        ball = collisions.add_triangle_mesh(*ball(10))
        blade = collisions.add_triangle_mesh(BLADE, BLADE_TRIANGLES)
        tetrahedron = collisions.add_tetrahedral_mesh(TETRAHEDRON, [[0, 1, 2, 3]])
        line = collisions.add_line_mesh([[0.5, 0, 0], [3, 0, 0]], [[0, 1]], 0.1)
        box = collisions.add_analytical_geometry(palpate.Box((5, 0, 0), (1, 1, 1)))
        points = np.random.default_rng(1).normal(size=(200, 3))

    Scene.queries = Scene.collisions.queries()
    return Scene


def test_closest_points(scene):
    batch = scene.queries.closest_points(scene.ball, scene.points)
    single = [scene.queries.closest_point(scene.ball, point) for point in scene.points]
    assert same(batch, np.array(single, batch.dtype))
    positions, triangles = ball(10)
    corners = positions[batch["vertices"]]
    assert np.allclose(np.einsum("ni,nij->nj", batch["weights"], corners), batch["position"])
    distances = np.linalg.norm(batch["position"] - scene.points, axis=1)
    assert np.allclose(distances, batch["distance"])
    near = scene.queries.closest_points(scene.ball, scene.points, max_distance=0.5)
    assert (np.isinf(near["distance"]) == (batch["distance"] > 0.5)).all()
    assert scene.queries.closest_point(scene.ball, [9, 9, 9], 0.5) is None
    assert scene.queries.closest_points(scene.ball, []).shape == (0,)
    with pytest.raises(palpate.Error, match="point 1") as caught:
        scene.queries.closest_points(scene.ball, [[0, 0, 0], [np.inf, 0, 0]])
    assert caught.value.code is palpate.ErrorCode.NON_FINITE_POSITION


def test_nearest_and_within(scene):
    nearest = scene.queries.nearest_elements(scene.ball, [2, 0, 0], 5)
    assert len(nearest) == 5 and (np.diff(nearest["distance"]) >= 0).all()
    within = scene.queries.elements_within(scene.ball, [2, 0, 0], 1.001 * nearest["distance"][-1])
    assert set(nearest["element"]) <= set(within) and within.dtype == np.uint32


def test_inside(scene):
    batch = scene.queries.contains(scene.ball, scene.points)
    assert batch.dtype == bool
    assert batch.tolist() == [scene.queries.contains(scene.ball, p) for p in scene.points]
    signed = scene.queries.signed_distances(scene.ball, scene.points)
    assert ((signed["distance"] < 0) == batch).all()
    one = scene.queries.signed_distance(scene.ball, scene.points[0])
    assert one.distance == signed[0].distance
    assert np.array_equal(one.nearest.position, signed["nearest"]["position"][0])
    wound = scene.queries.contains(scene.ball, scene.points, rule="winding_number")
    assert np.array_equal(wound, batch)
    with pytest.raises(palpate.Error) as caught:
        scene.queries.contains(scene.blade, [0, 0, 0])
    assert caught.value.code is palpate.ErrorCode.NOT_CLOSED
    inside = scene.queries.find_inside_vertices(scene.line, scene.ball)
    assert inside["vertex"].tolist() == [0] and inside[0].depth > 0
    embedded = scene.queries.find_embedded_vertices(scene.ball, scene.tetrahedron)
    assert embedded["at"]["weights"].shape == (len(embedded), 4) and len(embedded) > 0
    assert scene.queries.find_tetrahedron(scene.tetrahedron, [50, 0, 0]) is None


def test_rays(scene):
    origins, directions = 3 * scene.points, -scene.points
    hits = scene.queries.first_hits(scene.ball, origins, directions)
    for origin, direction, hit in zip(origins, directions, hits, strict=True):
        single = scene.queries.first_hit(scene.ball, origin, direction)
        assert single is not None and single.t == hit.t and single.element == hit.element
        assert scene.queries.any_hit(scene.ball, origin, direction)
    through = scene.queries.all_hits(scene.ball, [3, 0.1, 0.2], [-1, 0, 0])
    assert len(through) == 2 and through["front_face"].tolist() == [True, False]
    assert len(scene.queries.all_hits(scene.ball, [3, 0.1, 0.2], [-1, 0, 0], t_max=2.5)) == 1
    assert scene.queries.first_hit(None, [10, 0.1, 0.2], [-1, 0, 0]).geometry == scene.box
    assert scene.queries.first_hit(scene.ball, [3, 3, 3], [0, 0, 1]) is None
    pick = scene.queries.pick([0.1, 0.2, 9], [0, 0, -1])
    assert pick.hit.geometry == scene.ball and pick.edge.shape == (2,)
    every, begins = scene.queries.all_hits_of_rays(scene.ball, origins, directions)
    assert len(begins) == len(origins) + 1 and begins[0] == 0 and begins[-1] == len(every)
    for i, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        single = scene.queries.all_hits(scene.ball, origin, direction)
        assert np.array_equal(every[begins[i] : begins[i + 1]], single)
    with pytest.raises(palpate.Error):
        scene.queries.first_hits(scene.ball, origins, directions[:3])
    with pytest.raises(palpate.Error):
        scene.queries.all_hits_of_rays(scene.ball, origins, directions[:3])


def test_shapes_and_rigid_meshes(scene):
    pose = palpate.Pose(translation=(1.05, 0, 0))
    elements = scene.queries.overlapping(scene.ball, palpate.Sphere(radius=0.3), pose)
    contacts = scene.queries.contacts(scene.ball, palpate.Sphere(radius=0.3), pose, thickness=0.01)
    assert len(elements) > 0 and len(contacts) > 0
    assert np.allclose(np.linalg.norm(contacts["normal"], axis=1), 1)
    tool = palpate.RigidMesh(*ball(6, 0.3))
    data = scene.queries.contacts(scene.ball, tool, palpate.Pose(translation=(1.3, 0, 0)), 0.05)
    assert isinstance(data, palpate.CollisionData) and len(data.stencils().ids) > 0
    with pytest.raises(TypeError):
        scene.queries.contacts(scene.ball, "sphere")


def test_pairs_of_bodies(scene):
    distance = scene.queries.distance(scene.ball, scene.box)
    assert distance.distance == pytest.approx(3) and distance.a.geometry == scene.ball
    penetration = scene.queries.penetration(scene.ball, scene.tetrahedron)
    assert penetration.intersecting and penetration.depth > 0
    line = [[-3, 0.1, 0.2], [3, 0.1, 0.2]]
    inside, outside = scene.queries.path(line, 0.05, [scene.ball, scene.box])
    assert inside["body"].tolist() == [scene.ball] and outside["body"].tolist() == [scene.box]
    assert inside[0].leave - inside[0].enter == pytest.approx(2, abs=0.2)


def test_tracker():
    positions, triangles = ball(10)
    collisions = palpate.OctreeBasedCD()
    body = collisions.add_triangle_mesh(positions, triangles)
    tip = collisions.add_point_set([[0.9, 0, 0]])
    tracker = palpate.PenetrationTracker(tip, body)
    collisions.advance()
    for step in range(3):
        collisions.set_positions(tip, [[0.9 - 0.1 * step, 0, 0]])
        tracked = tracker.update(collisions.queries())
        assert tracked["penetration"]["vertex"].tolist() == [0]
        change = palpate.DirectionChange.NONE if step else palpate.DirectionChange.ENTERED
        assert tracked["change"][0] == change
        collisions.advance()


def test_outdated_queries(scene):
    collisions = palpate.OctreeBasedCD()
    mesh = collisions.add_triangle_mesh(*ball(4))
    queries = collisions.queries()
    collisions.advance()
    with pytest.raises(palpate.Error) as caught:
        queries.closest_points(mesh, [[0, 0, 0]])
    assert caught.value.code is palpate.ErrorCode.INVALID_CALL


def test_distance_functions():
    p, a, b, c = np.random.default_rng(2).normal(size=(4, 50, 3))
    records = palpate.vertex_triangle_distance(p, a, b, c)
    closest = np.einsum("ni,nij->nj", records["weights"], np.stack([a, b, c], axis=1))
    assert np.allclose(p - closest, records["difference"])
    single = palpate.vertex_triangle_distance(p[3], a[3], b[3], c[3])
    assert single.distance == records[3].distance
    fixed = palpate.vertex_triangle_distance(p, a[3], b[3], c[3])
    assert fixed.shape == (50,) and fixed[3].distance == single.distance
    edges = palpate.edge_edge_distance(p, a, b, c)
    assert np.allclose(np.linalg.norm(edges["difference"], axis=1), edges["distance"])
    other = [0, 0, 0], [0, 0, 1], [1, 1, 1]
    assert palpate.triangles_intersect([0, 0, 0], [1, 0, 0], [0, 1, 0], *other)
    assert palpate.triangles_intersect(p, a, b, c, a, b).all()
    rest = ([0, 0, 0], [1, 0, 0], [0, 1, 0])
    time = palpate.vertex_triangle_time_of_impact([0.2, 0.2, 1], *rest, [0.2, 0.2, -1], *rest)
    assert time == pytest.approx(0.5, abs=1e-6)
    assert palpate.vertex_triangle_time_of_impact([5, 5, 1], *rest, [5, 5, -1], *rest) is None
    before, now = [[0.2, 0.2, 1], [5, 5, 1]], [[0.2, 0.2, -1], [5, 5, -1]]
    times = palpate.vertex_triangle_time_of_impact(
        before, *rest, now, *rest, minimum_distance=0.5
    )
    assert times[0] == pytest.approx(0.25, abs=1e-5) and np.isnan(times[1])
    edge = ([0, 0, 0], [1, 0, 0])
    assert palpate.edge_edge_time_of_impact(
        *edge, [0.5, -1, 1], [0.5, 1, 1], *edge, [0.5, -1, -1], [0.5, 1, -1]
    ) == pytest.approx(0.5, abs=1e-6)
    tangents = palpate.tangents_of([[0, 0, 1.0], [1, 0, 0]])
    assert tangents.shape == (2, 2, 3) and tangents[0].tolist() == [[1, 0, 0], [0, 1, 0]]
    assert np.array_equal(palpate.tangents_of([0, 0, 1.0], tangents[0]), tangents[0])
    with pytest.raises(palpate.Error):
        palpate.vertex_triangle_distance(p, a[:7], b, c)
    with pytest.raises(TypeError):
        palpate.vertex_triangle_distance(p, a, b)
