"""No array ever shows freed or changed memory."""

import gc
import weakref

import numpy as np
import pytest

import palpate
from scenes import Balls, Cut, same


def arrays_of(data):
    return [
        data.vertex_triangle,
        data.triangle_vertex,
        data.edge_edge,
        data.edge_edge["normal"],
        *data.stencils(),
    ]


def test_old_arrays_stay_while_frames_go_on():
    scene = Balls()
    collisions = scene.collisions
    held = []
    for number in range(20):
        data = scene.step(10 + number)
        collisions.publish(number)
        snapshot = collisions.latest_snapshot()
        queries = collisions.queries()
        points = np.random.default_rng(number).normal(size=(50, 3))
        held += arrays_of(data)
        held += [
            collisions.positions(scene.b),
            snapshot.positions(scene.b),
            snapshot.positions_before(scene.b),
            queries.closest_points(scene.b, points),
            snapshot.queries().closest_points(scene.b, points),
            data.constraint_rows(),
            collisions.octree().nodes(scene.a)[0].bounds,
            collisions.octree().nodes(scene.a)[-1].elements,
        ]
        if number == 0:
            first = data.vertex_triangle[0]  # a single record holds its array
    copies = [array.copy() for array in held]
    expected = first.copy()
    normals = [row.copy() for row in held[0]["normal"]]
    del data, snapshot, queries
    for number in range(20):
        scene.step(100 + 7 * number)
        collisions.publish(number)
    collisions.set_triangles(scene.a, scene.positions[:3], [[0, 1, 2]])
    collisions.detect_collision()
    collisions.remove_geometry(scene.b)
    collisions.release_memory()
    del collisions
    del scene
    gc.collect()
    junk = [np.full(10**5, 7.0) for _ in range(50)]  # reuses memory that was freed
    for array, copy in zip(held, copies, strict=True):
        assert same(array, copy)
    assert first == expected and len(junk) == 50
    assert all(np.array_equal(a, b) for a, b in zip(held[0]["normal"], normals, strict=True))


def test_arrays_of_results_cannot_be_written():
    scene = Cut()
    data = scene.detect()
    with pytest.raises(ValueError):
        data.vertex_triangle["distance"] = 0
    with pytest.raises(ValueError):
        data.vertex_triangle[0]["normal"][:] = 0
    scene.collisions.publish()
    with pytest.raises(ValueError):
        scene.collisions.latest_snapshot().positions(scene.blade)[:] = 0
    pose = palpate.Pose()
    with pytest.raises(ValueError):
        pose.rotation[0, 0] = 2
    positions = scene.collisions.positions(scene.blade)
    positions[:] = 0  # a copy of its own
    assert scene.collisions.positions(scene.blade).any()


def test_what_goes_in_is_not_kept():
    scene = Balls()
    given = scene.positions.copy()
    scene.collisions.set_positions(scene.a, given)
    before = scene.step(10).hash()
    given[:] = np.nan
    scene.collisions.set_positions(scene.a, scene.positions)
    assert scene.step(10).hash() == before


def test_queries_and_guards_keep_the_object_alive():
    scene = Cut()
    queries, guard = scene.collisions.queries(), palpate.StepGuard(scene.collisions)
    octree = scene.collisions.octree()
    alive = weakref.ref(scene)
    organ = scene.organ
    del scene
    gc.collect()
    assert alive() is None
    assert queries.closest_point(organ, [1, 2, 3]).distance == 3
    assert octree.validate() == []
    assert guard.hold() == 2
    with pytest.raises(palpate.Error) as caught:
        queries.closest_point(organ, [1, 2, 3])  # positions changed
    assert caught.value.code is palpate.ErrorCode.INVALID_CALL


def test_a_topology_keeps_the_object_alive():
    scene = Cut()
    topology = palpate.ThreadTopology(scene.collisions)
    index = topology.add((scene.blade, [0, 1]), (scene.organ, [0, 1, 2]))
    del scene
    gc.collect()
    topology.update()
    assert not topology.is_lost(index)


def test_snapshots_outlive_the_object():
    scene = Cut()
    scene.collisions.publish(2.5)
    snapshot, blade, organ = scene.collisions.latest_snapshot(), scene.blade, scene.organ
    queries = snapshot.queries()
    positions = snapshot.positions(blade)
    del scene
    gc.collect()
    assert queries.closest_point(organ, [1, 2, 3]).distance == 3
    expected = positions.copy()
    del snapshot
    gc.collect()
    assert queries.closest_point(organ, [1, 2, 3]).distance == 3
    assert np.array_equal(positions, expected)


def test_predicates_are_released():
    class Predicate:
        def __call__(self, features):
            return True

    scene = Cut()
    predicate = Predicate()
    gone = weakref.ref(predicate)
    scene.collisions.set_contact_predicate(scene.blade, scene.organ, predicate)
    del predicate
    scene.detect()
    assert gone() is not None
    scene.collisions.set_contact_predicate(scene.blade, scene.organ, None)
    gc.collect()
    assert gone() is None
