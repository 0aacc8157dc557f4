"""PairSettings.track_contacts and report_crossings."""

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
    collisions, tips, sheet = scene(method="continuous", report_crossings=True)
    collisions.advance()
    collisions.set_positions(tips, np.array([[3, 3, -0.1], [2, 3, 0.1]]))
    collisions.detect_collision()
    (crossing,) = collisions.collision_data(tips, sheet).crossings
    assert crossing.kind == palpate.ContactKind.VERTEX_TRIANGLE
    assert crossing.ids[:2].tolist() == [0, 0]
    assert 0.5 - 1e-6 <= crossing.time <= 0.5
    assert not crossing.forward
    with pytest.raises(palpate.Error, match="reportCrossings"):
        collisions.set_pair_settings(tips, sheet, report_crossings=True)
