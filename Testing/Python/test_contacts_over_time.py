"""PairSettings.track_contacts, report_crossings, smooth_normals and remember_sides."""

import numpy as np
import pytest

import palpate

CORNERS = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [10, 10, 0]], float)
TRIANGLES = np.array([[0, 1, 2], [1, 3, 2]])


def scene(**settings):
    collisions = palpate.OctreeBasedCD()
    sheet = collisions.add_triangle_mesh(CORNERS, TRIANGLES)
    tips = collisions.add_point_set(np.array([[3, 3, 0.1], [2, 3, 0.1]]))
    collisions.add_collision_pair(tips, sheet, thickness=0.2, **settings)
    return collisions, tips, sheet


def test_contacts_slide_with_their_data():
    collisions, tips, sheet = scene(method="proximity", track_contacts=True)
    collisions.detect_collision()
    tracked = collisions.collision_data(tips, sheet).tracked_vertex_triangle
    assert tracked["age"].tolist() == [0, 0]
    assert not tracked["has_predecessor"].any()
    collisions.set_user_data(tips, sheet, tracked["key"], [7, 2**63])
    collisions.set_user_data(tips, sheet, tracked[0].key, 8)
    with pytest.raises(ValueError, match="3 numbers for 2 keys"):
        collisions.set_user_data(tips, sheet, tracked["key"], [1, 2, 3])
    collisions.advance()
    collisions.set_positions(tips, np.array([[6, 6, 0.1], [2, 3, 5.0]]))
    collisions.detect_collision()
    data = collisions.collision_data(tips, sheet)
    (slid,) = data.tracked_vertex_triangle
    assert slid.key.kind == palpate.ContactKind.VERTEX_TRIANGLE
    assert slid.key.ids.tolist() == [0, 1, palpate.NO_ELEMENT, palpate.NO_ELEMENT]
    assert slid.has_predecessor and slid.predecessor.ids[1] == 0
    assert (slid.age, slid.user_data) == (1, 8)
    (ended,) = data.ended
    assert (ended.end, ended.user_data) == (palpate.ContactEnd.APART, 2**63)
    assert len(data.tracked_edge_edge) == len(data.tracked_triangle_vertex) == 0


def test_user_data_of_a_field_and_of_each_second_number():
    collisions, tips, sheet = scene(method="proximity", track_contacts=True)

    def tracked():
        collisions.detect_collision()
        return collisions.collision_data(tips, sheet).tracked_vertex_triangle

    for data in (np.array([5, 6, 7, 8], np.uint64)[::2], np.array([5, 6, 7])[::2]):
        collisions.set_user_data(tips, sheet, tracked()["key"], data)
        assert tracked()["user_data"].tolist() == [5, 7]
    before = tracked()
    collisions.set_user_data(tips, sheet, before["key"], [0, 0])
    collisions.set_user_data(tips, sheet, before["key"], before["user_data"])
    assert tracked()["user_data"].tolist() == [5, 7]


def test_user_data_that_are_refused_change_nothing():
    collisions, tips, sheet = scene(method="proximity", track_contacts=True)
    collisions.detect_collision()
    keys = collisions.collision_data(tips, sheet).tracked_vertex_triangle["key"]
    collisions.set_user_data(tips, sheet, keys, [5, 6])
    for error, data in (
        (OverflowError, [1, -1]),
        (OverflowError, [1, 2**64]),
        (TypeError, [1, 1.5]),
        (TypeError, np.array([1.0, 2.0])),
    ):
        with pytest.raises(error):
            collisions.set_user_data(tips, sheet, keys, data)
    unknown = keys.copy()
    unknown["ids"][1, 0] = 9
    with pytest.raises(palpate.Error, match="no contact with this key"):
        collisions.set_user_data(tips, sheet, unknown, 1)
    data = collisions.collision_data(tips, sheet).tracked_vertex_triangle["user_data"]
    assert data.tolist() == [5, 6]


def test_crossings_are_records():
    collisions, tips, sheet = scene(report_crossings=True)
    collisions.advance()
    collisions.set_positions(tips, np.array([[3, 3, -0.1], [2, 3, 0.1]]))
    collisions.detect_collision()
    (crossing,) = collisions.collision_data(tips, sheet).crossings
    assert crossing.kind == palpate.ContactKind.VERTEX_TRIANGLE
    assert crossing.ids[:2].tolist() == [0, 0]
    assert 0.5 - 1e-6 <= crossing.time <= 0.5
    assert not crossing.forward
    with pytest.raises(palpate.Error, match="reportCrossings"):
        collisions.set_pair_settings(
            tips, sheet, method="proximity", thickness=0.2, report_crossings=True
        )


def test_smooth_normals_are_those_of_rows():
    corners = CORNERS + np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, -2]])
    collisions = palpate.OctreeBasedCD()
    sheet = collisions.add_triangle_mesh(corners, TRIANGLES)
    tips = np.array([[4.9, 4.9, 0.1]])
    points = collisions.add_point_set(tips)
    collisions.add_collision_pair(
        points, sheet, method="proximity", thickness=0.2, smooth_normals=True
    )
    collisions.detect_collision()
    data = collisions.collision_data(points, sheet)
    (contact,) = data.vertex_triangle
    (smooth,) = data.smooth_vertex_triangle
    assert contact.normal.tolist() == [0, 0, 1]
    assert smooth[0] == pytest.approx(smooth[1]) and 0.05 < smooth[0] < smooth[2] < 1
    (row,) = data.constraint_rows(tips, corners)
    assert row["normal"].tolist() == smooth.tolist()
    for name in ("triangle_vertex", "edge_edge", "shape"):
        assert getattr(data, "smooth_" + name).shape == (0, 3)


def test_sides_are_remembered_and_set():
    collisions, tips, sheet = scene(remember_sides=True)
    for z in (0.1, -0.1):
        collisions.set_positions(tips, np.array([[3, 3, z], [2, 3, 0.1]]))
        collisions.detect_collision()
        collisions.advance()
    collisions.detect_collision()
    data = collisions.collision_data(tips, sheet)
    assert len(data.crossings) == 0
    (side,) = data.remembered_sides
    assert side.ids[:2].tolist() == [0, 0] and not side.forward and side.time == 0
    assert data.vertex_triangle["distance"].tolist() == pytest.approx([-0.1, 0.1])
    assert data.vertex_triangle["normal"].tolist() == [[0, 0, 1], [0, 0, 1]]
    assert (collisions.problem().pairs[0].sides == data.remembered_sides).all()
    collisions.set_remembered_sides(tips, sheet, data.remembered_sides[:0])
    collisions.detect_collision()
    assert len(collisions.collision_data(tips, sheet).remembered_sides) == 0
    collisions.set_remembered_sides(tips, sheet, data.remembered_sides)
    collisions.detect_collision()
    again = collisions.collision_data(tips, sheet)
    assert again.hash() == data.hash()
    with pytest.raises(palpate.Error, match="rememberSides"):
        collisions.set_pair_settings(
            tips, sheet, method="proximity", thickness=0.2, remember_sides=True
        )


def test_advance_calls_a_predicate_of_python():
    collisions, tips, sheet = scene(method="continuous", remember_sides=True)
    collisions.set_contact_predicate(tips, sheet, lambda features: features.a[0] == 1)
    collisions.detect_collision()
    collisions.advance()
    collisions.set_positions(tips, np.array([[3, 3, -0.1], [2, 3, -0.1]]))
    collisions.advance()
    (side,) = collisions.problem().pairs[0].sides
    assert side.ids[0] == 1


def test_a_stitch_and_two_parts_of_threads() -> None:
    hole = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    thread = np.array([[3, 0.1, -1], [3, 0.1, 1.0]])
    collisions = palpate.OctreeBasedCD()
    loop_id = collisions.add_line_mesh(hole, [[0, 1], [1, 2], [2, 3], [3, 0]])
    thread_id = collisions.add_line_mesh(thread, [[0, 1]])
    topology = palpate.ThreadTopology(collisions)
    stitch = topology.add((thread_id, [0, 1]), (loop_id, [0, 1, 2, 3]))
    parts = topology.add_parts((thread_id, [0, 1]), (loop_id, [0, 1, 2, 3]))
    counts = []
    for x in (0.0, -3.0):
        collisions.advance()
        collisions.set_positions(thread_id, thread - [3 - x, 0, 0])
        topology.update()
        counts.append((topology.count(stitch), topology.count(parts)))
    assert counts == [(1, 1), (0, 1)]  # the last side of the loop is no edge of the second part
    events = topology.events()
    assert events["index"].tolist() == [stitch, parts, stitch]
    assert (events["cause"] == palpate.ThreadEventCause.PASSED).all()
    assert events["change"].tolist() == [1, 1, -1] and events["step"].tolist() == [1, 1, 2]
    assert events["thread"].tolist() == [[0, 1]] * 3
    assert events["loop"].tolist() == [[1, 2], [1, 2], [3, 0]]
    assert events["time"] == pytest.approx([2 / 3, 2 / 3, 1 / 3])
    state = topology.save()
    other = palpate.ThreadTopology(collisions)
    other.restore(state)
    assert other.save() == state and other.count(parts) == 1
    with pytest.raises(palpate.Error, match="byte"):
        other.restore(state[:-1])
    topology.clear()
    collisions.set_disabled_elements(thread_id, [0])
    topology.update()
    assert topology.is_lost(stitch) and topology.count(stitch) == 0
    assert topology.events()["cause"].tolist() == [palpate.ThreadEventCause.DISABLED] * 2
    with pytest.raises(palpate.Error) as caught:
        topology.count(2)
    assert caught.value.code is palpate.ErrorCode.INDEX_OUT_OF_RANGE
    with pytest.raises(TypeError, match="geometry, vertices"):
        topology.add(thread_id, (loop_id, [0, 1, 2]))
