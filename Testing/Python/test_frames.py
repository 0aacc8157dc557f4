"""Frames: contacts, their forms for solvers, settings, errors, representations and pickles."""

import copy
import dataclasses
import json
import pickle

import numpy as np
import pytest

import palpate
from scenes import BLADE, BLADE_MOVED, BLADE_TRIANGLES, TETRAHEDRON, Balls, Cut, ball, same


def test_contacts_of_the_first_program():
    data = Cut().detect()
    assert len(data.vertex_triangle) == 1 and len(data.triangle_vertex) == 0
    contact = data.vertex_triangle[0]
    assert (contact.vertex, contact.triangle) == (0, 0)
    assert contact.normal.tolist() == [0, 0, 1]
    assert contact.time_of_impact == pytest.approx(0.125, abs=1e-6)
    assert contact["distance"] == pytest.approx(0.5)
    edge = data.edge_edge[0]
    assert edge.edge_a.tolist() == [0, 1] and edge.edge_b.tolist() == [0, 1]
    assert data.earliest_time_of_impact == contact.time_of_impact
    assert data.validity.trusted and data.validity.method is palpate.Method.CONTINUOUS
    assert data.validity.displacement_over_limit == pytest.approx(16)


def test_stencils_obey_the_law_of_contacts():
    scene = Balls()
    data = scene.step(30)
    ids, weights, normals, distances = data.stencils(first_b=len(scene.positions))
    assert ids.shape == weights.shape == (len(distances), 4) and len(distances) > 10
    x = np.concatenate([scene.positions, scene.collisions.positions(scene.b)])
    between = np.einsum("ni,nij->nj", weights, x[ids])
    assert np.allclose(between, distances[:, None] * normals, atol=1e-13)
    count = len(data.vertex_triangle)
    assert (ids[:count, 0] < len(scene.positions)).all()
    assert (ids[count : count + len(data.triangle_vertex), 0] >= len(scene.positions)).all()


def test_rows_give_the_gaps():
    scene = Balls()
    data = scene.step(30)
    x = np.concatenate([scene.positions, scene.collisions.positions(scene.b)])
    rows = data.rows(scene.positions, scene.collisions.positions(scene.b))
    assert rows.jacobian.shape == (len(rows.offsets), x.size)
    gaps = rows.jacobian @ x.ravel() - rows.offsets
    assert np.allclose(gaps, data.stencils().distances, atol=1e-13)
    records = data.constraint_rows(
        palpate.SolverVertices(scene.positions),
        palpate.SolverVertices(scene.collisions.positions(scene.b), first=len(scene.positions)),
    )
    assert np.array_equal(records["offset"], rows.offsets)
    wide = data.rows(scene.positions, x[len(scene.positions) :], vertex_count=5000)
    assert wide.jacobian.shape[1] == 15000


def test_rows_without_arrays_take_the_positions_of_the_step():
    scene = Balls()
    data = scene.step(30)
    first = len(scene.positions)
    given = data.constraint_rows(scene.positions, scene.collisions.positions(scene.b))
    assert np.array_equal(data.constraint_rows(first_b=first), given)
    rows = data.rows(first_b=first, vertex_count=5000)
    assert np.array_equal(rows.offsets, given["offset"])
    assert rows.jacobian.shape == (len(given), 15000)
    assert data.rows(first_b=first).jacobian.shape[1] == 3 * (given["vertices"].max() + 1)
    scene.step(31)
    assert np.array_equal(data.constraint_rows(first_b=first), given)  # it is a copy
    with pytest.raises(palpate.Error, match="not known"):
        pickle.loads(pickle.dumps(data)).constraint_rows()
    with pytest.raises(palpate.Error, match="not those of the detected step"):
        data.constraint_rows(scene.positions + 1.0, scene.positions)


def test_rows_of_a_moving_shape():
    collisions = palpate.OctreeBasedCD()
    mesh = collisions.add_triangle_mesh(TETRAHEDRON, [[0, 1, 2]])
    tip = collisions.add_analytical_geometry(palpate.Sphere(radius=1))
    collisions.add_collision_pair(mesh, tip, method="continuous")
    motion = palpate.RigidMotion(
        palpate.Pose(translation=(5, 5, 3)), palpate.Pose(translation=(5, 5, 0.5))
    )
    collisions.set_transform(tip, motion.before, motion.now)
    collisions.detect_collision()
    data = collisions.collision_data(mesh, tip)
    assert len(data.shape) == 1
    rows = data.rows(TETRAHEDRON, motion=motion)
    gap = rows.jacobian @ TETRAHEDRON.ravel() - rows.offsets
    assert gap == pytest.approx([-0.5], abs=1e-5)
    motions = data.motions(palpate.ContactSide(TETRAHEDRON), palpate.ContactSide(motion=motion))
    assert np.allclose(motions["relative_displacement"], [[0, 0, 2.5]])


def test_settings_are_keywords_or_objects():
    collisions = palpate.OctreeBasedCD(engine="brute-force", threads=1, memory_limit=10**9)
    assert collisions.settings() == palpate.Settings(
        engine=palpate.Engine.BRUTE_FORCE, threads=1, memory_limit=10**9
    )
    a = collisions.add_triangle_mesh(BLADE, BLADE_TRIANGLES)
    b = collisions.add_triangle_mesh(*ball(4))
    settings = palpate.PairSettings(method="Continuous", thickness=0.25)
    collisions.add_collision_pair(a, b, settings, time_tolerance=1e-3)
    assert collisions.pair_settings(a, b) == dataclasses.replace(settings, time_tolerance=1e-3)
    collisions.set_pair_settings(a, b, method=palpate.Method.INTERSECTION)
    assert collisions.pairs() == [
        palpate.CollisionPair(a, b, palpate.PairSettings(method="intersection"))
    ]
    collisions.set_collision_filter(a, groups=2, mask=5, sidedness="outer")
    filter = collisions.problem().geometries[a].filter
    assert filter == palpate.CollisionFilter(groups=2, mask=5, sidedness="outer")


def test_defaults_are_those_of_the_library():
    collisions = palpate.OctreeBasedCD()
    assert collisions.settings() == palpate.Settings()
    a = collisions.add_triangle_mesh(*ball(4))
    b = collisions.add_point_set(BLADE)
    collisions.add_collision_pair(a, b)
    assert collisions.pair_settings(a, b) == palpate.PairSettings()
    assert collisions.problem().geometries[a].filter == palpate.CollisionFilter()


@pytest.mark.parametrize(
    "keywords, error",
    [
        ({"method": "fast"}, palpate.Error),
        ({"method": 17}, palpate.Error),
        ({"method": palpate.Engine.OCTREE}, palpate.Error),
        ({"thickness": -1}, palpate.Error),
        ({"thickness": float("nan")}, palpate.Error),
        ({"thickness": "wide"}, TypeError),
        ({"thickness": None}, TypeError),
        ({"thicknes": 1}, TypeError),
        ({"earliest_time_only": True}, palpate.Error),
    ],
)
def test_settings_that_are_refused(keywords, error):
    scene = Cut()
    with pytest.raises(error) as caught:
        scene.collisions.set_pair_settings(scene.blade, scene.organ, **keywords)
    if error is palpate.Error:
        assert caught.value.code is palpate.ErrorCode.INVALID_SETTINGS
    assert scene.collisions.pair_settings(scene.blade, scene.organ).thickness == 0.5


def test_errors_name_what_is_at_fault():
    scene = Cut()
    with pytest.raises(palpate.Error) as caught:
        scene.collisions.set_positions(scene.organ, BLADE)
    error = caught.value
    assert isinstance(error, Exception) and not isinstance(error, palpate.ErrorCode)
    assert error.code is palpate.ErrorCode.WRONG_POSITION_COUNT and error.geometry == scene.organ
    assert str(palpate.ErrorCode.WRONG_POSITION_COUNT) == "ErrorCode.WRONG_POSITION_COUNT"
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.code, again.geometry) == (str(error), error.code, error.geometry)
    with pytest.raises(palpate.Error) as caught:
        palpate.OctreeBasedCD().collision_data(0, 1)
    assert caught.value.code is palpate.ErrorCode.UNKNOWN_GEOMETRY


def test_transforms():
    collisions = palpate.OctreeBasedCD()
    mesh = collisions.add_triangle_mesh(BLADE, BLADE_TRIANGLES)
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    collisions.set_transform(mesh, turn, [1, 2, 3])
    pose = collisions.transform(mesh)
    assert pose == palpate.Pose(turn, (1, 2, 3)) and pose != palpate.Pose()
    placed = BLADE @ turn.T + [1, 2, 3]
    assert np.allclose(collisions.bounds(mesh), [placed.min(axis=0), placed.max(axis=0)])
    collisions.set_transform(mesh, palpate.Pose(), pose)
    collisions.publish(1.5)
    motion = collisions.latest_snapshot().motion(mesh)
    assert motion == palpate.RigidMotion(palpate.Pose(), pose)
    with pytest.raises(palpate.Error) as caught:
        collisions.set_transform(mesh, 2 * turn, [0, 0, 0])
    assert caught.value.code is palpate.ErrorCode.INVALID_TRANSFORM
    with pytest.raises(palpate.Error):
        palpate.Pose(np.zeros((2, 2)))
    with pytest.raises(TypeError):
        collisions.set_transform(mesh, turn)


def test_results_and_settings_can_be_pickled():
    data = Cut().detect()
    for other in pickle.loads(pickle.dumps(data)), copy.deepcopy(data):
        assert other == data and other.hash() == data.hash() and hash(other) == hash(data)
        assert other.validity == data.validity and repr(other) == repr(data)
        assert same(other.vertex_triangle, data.vertex_triangle)
    assert data != Cut(thickness=0.25).detect() and data != 3
    for value in (
        palpate.Settings(threads=2, audit=palpate.AuditSettings(features=3)),
        palpate.Settings(executor=palpate.make_thread_pool(1)),
        palpate.PairSettings(method="proxy", allowed_error=0.5),
        palpate.CollisionFilter(groups=4),
        palpate.InsideSettings(rule="winding_number"),
        palpate.Pose(translation=(1, 2, 3)),
        palpate.ConvexHull([[0, 0, 0], [1, 2, 3]]),
        palpate.Capsule((0, 0, 0), (1, 0, 0), 0.5),
        data.validity,
        Cut().collisions.statistics(),
    ):
        again = pickle.loads(pickle.dumps(value))
        if isinstance(value, palpate.Settings):
            value = dataclasses.replace(value, executor=None)
        assert again == value and repr(again) == repr(value)


def test_representations_tell_what_a_thing_is():
    scene = Cut()
    texts = [
        repr(value)
        for value in (
            scene.detect(),
            scene.collisions,
            scene.collisions.octree(),
            scene.collisions.queries(),
            scene.collisions.problem(),
            scene.collisions.problem().geometries[0],
            scene.collisions.problem().pairs[0],
            palpate.StepGuard(scene.collisions),
            palpate.ThreadTopology(scene.collisions),
            palpate.RigidMesh(BLADE, BLADE_TRIANGLES),
            palpate.PenetrationTracker(0, 1),
            palpate.make_thread_pool(1),
        )
    ]
    assert all(text.startswith("<palpate.") and " at 0x" not in text for text in texts)
    assert "1 vertex-triangle, 1 edge-edge, by Continuous, trusted" in texts[0]
    assert "'proximity'" not in repr(palpate.PairSettings(method="proximity"))


def test_topology_filters_and_pairs():
    scene = Balls()
    collisions, a, b = scene.collisions, scene.a, scene.b
    assert len(scene.step(30).stencils().ids) > 0
    collisions.set_disabled_elements(a, np.arange(len(scene.triangles)))
    assert len(scene.step(31).stencils().ids) == 0
    collisions.set_triangles(a, *ball(6))
    assert collisions.vertex_count(a) == len(ball(6)[0])
    assert len(scene.step(32).stencils().ids) > 0
    collisions.set_name(a, "liver")
    assert collisions.name(a) == "liver"
    collisions.remove_collision_pair(b, a)
    assert collisions.pairs() == []
    with pytest.raises(palpate.Error) as caught:
        collisions.collision_data(a, b)
    assert caught.value.code is palpate.ErrorCode.UNKNOWN_PAIR
    assert "liver" in str(caught.value) or "pair" in str(caught.value)
    collisions.remove_geometry(b)
    assert not collisions.has(b) and collisions.has(a)


def test_tetrahedral_meshes():
    collisions = palpate.OctreeBasedCD()
    mesh = collisions.add_tetrahedral_mesh(TETRAHEDRON, [[0, 1, 2, 3]])
    surface = collisions.surface(mesh)
    assert surface.triangles.shape == (4, 3) and surface.tetrahedra.tolist() == [0] * 4
    collisions.set_tetrahedra(mesh, TETRAHEDRON, [[3, 2, 1, 0]])
    assert collisions.queries().find_tetrahedron(mesh, [1, 1, -1]).tetrahedron == 0


def test_candidates_statistics_and_octrees():
    scene = Balls()
    collisions, a, b = scene.collisions, scene.a, scene.b
    scene.step(20)
    kept = collisions.candidate_pairs(a, b)
    assert kept.dtype == np.uint32 and kept.shape[1] == 2 and len(kept) > 0
    batches, pairs = [], []
    collisions.for_each_candidate(a, b, batches.append)
    collisions.for_each_candidate(lambda pair, batch: pairs.append((pair.a, len(batch))))
    assert sorted(map(tuple, np.concatenate(batches).tolist())) == list(map(tuple, kept.tolist()))
    assert sum(count for _, count in pairs) == len(kept)
    assert np.array_equal(collisions.candidate_pairs(b, a), kept)
    scene.step(21)
    statistics = collisions.statistics()
    assert statistics.geometries == 2 and statistics.triangles == 2 * len(scene.triangles)
    assert statistics.milliseconds.total > 0
    assert collisions.pair_statistics(a, b).contacts == statistics.contacts
    assert collisions.memory_use().total == statistics.memory.total
    collisions.release_memory()
    octree = collisions.octree()
    assert octree.validate() == []
    nodes = octree.nodes(a)
    assert nodes[0].geometry == a and nodes[0].parent is None and nodes[0].bounds.shape == (2, 3)
    assert all(node.parent < i for i, node in enumerate(nodes[1:], 1))
    assert sorted(e for node in nodes for e in node.elements) == list(range(len(scene.triangles)))
    assert octree.geometries() == [a, b]
    assert octree.statistics().elements == 2 * len(scene.triangles)
    assert isinstance(octree.last_update(b), palpate.LooseOctreeUpdate)


def test_traces_are_json_of_nested_events(tmp_path):
    file = tmp_path / "frames.json"
    scene = Balls(trace_frames=3, threads=2)
    hashes = [scene.step(step).hash() for step in range(5)]
    scene.collisions.write_trace(file)
    events = json.loads(file.read_text())["traceEvents"]
    assert {event["args"]["frame"] for event in events} == {3, 4, 5}
    jobs = [event for event in events if event["name"] == "job"]
    assert jobs and all((j["args"]["a"], j["args"]["b"]) == (scene.a, scene.b) for j in jobs)
    for thread in {event["tid"] for event in events}:
        ends = []
        own = [event for event in events if event["tid"] == thread]
        for event in sorted(own, key=lambda e: (e["ts"], -e["dur"])):
            begin, end = event["ts"], event["ts"] + event["dur"]
            while ends and ends[-1] <= begin:
                ends.pop()
            assert event["dur"] >= 0 and (not ends or end <= ends[-1] + 1e-3)
            ends.append(end)
    untraced = Balls(threads=2)
    assert [untraced.step(step).hash() for step in range(5)] == hashes
    with pytest.raises(palpate.Error) as caught:
        untraced.collisions.write_trace(file)
    assert caught.value.code is palpate.ErrorCode.NOT_AVAILABLE


def test_two_meshes_in_one_call():
    positions, triangles = ball(8)
    data = palpate.detect_collision(
        positions, triangles, positions + [1.9, 0, 0], triangles, method="intersection"
    )
    assert len(data.intersecting_triangles) > 0
    with pytest.raises(palpate.Error) as caught:
        palpate.detect_collision(positions, triangles, positions, triangles, method="continuous")
    assert caught.value.code is palpate.ErrorCode.UNSUPPORTED_METHOD


def test_step_guard():
    scene = Cut()
    guard = palpate.StepGuard(scene.collisions)
    assert guard.hold() == 2 and guard.rounds > 0
    held = guard.held()
    assert (held["geometry"] == scene.blade).all() and (held["fraction"] < 1).all()
    assert not np.array_equal(scene.collisions.positions(scene.blade), BLADE_MOVED)
    scene.collisions.set_positions(scene.blade, BLADE, BLADE_MOVED)
    guard.set_fixed_vertices(scene.blade, None)
    with pytest.raises(palpate.Error) as caught:
        guard.hold()
    assert caught.value.code is palpate.ErrorCode.IMPACT_REMAINS
    guard.set_fixed_vertices(scene.blade, [])
    guard.add_rigid_group([(scene.blade, 0), (scene.blade, 1), (scene.blade, 2)])
    guard.add_rigid_group([(scene.organ, None)])
    assert guard.hold() == 3 and len(set(guard.held()["fraction"])) == 1
    scene.collisions.set_positions(scene.blade, BLADE, BLADE_MOVED)
    guard.set_guarded(scene.blade, scene.organ, False)
    assert guard.hold() == 0


def test_help_reads_well():
    for kind in vars(palpate).values():
        if not isinstance(kind, type) or kind.__module__ != "palpate":
            continue
        assert kind.__doc__, kind
        for name, member in vars(kind).items():
            if not name.startswith("_") and (callable(member) or isinstance(member, property)):
                text = getattr(member, "__doc__", None)
                assert text and "_palpate" not in text and "self:" not in text, (kind, name)


def test_positions_of_some_vertices() -> None:
    collisions = palpate.OctreeBasedCD()
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    mesh = collisions.add_triangle_mesh(positions, [[0, 1, 2], [1, 3, 2]])
    collisions.set_positions(mesh, [[5.0, 6, 7], [8, 9, 10]], first=1)
    positions[1:3] = [[5, 6, 7], [8, 9, 10]]
    assert (collisions.positions(mesh) == positions).all()
    with pytest.raises(palpate.Error, match="2 positions given from vertex 3 on, but it has 4"):
        collisions.set_positions(mesh, positions[:2], first=3)
    with pytest.raises(TypeError, match="not both"):
        collisions.set_positions(mesh, positions, positions, first=0)
