"""detect_collision() with a budget, and cancel_detection()."""

import math
import threading

import numpy as np
import pytest

import palpate

CORNERS = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0]], float)
TRIANGLES = np.array([[0, 1, 2]])


def scene(height, **settings):
    collisions = palpate.OctreeBasedCD()
    sheet = collisions.add_triangle_mesh(CORNERS, TRIANGLES)
    tips = collisions.add_point_set(np.array([[3, 3, height]]))
    collisions.add_collision_pair(tips, sheet, thickness=0.2, **settings)
    return collisions, tips, sheet


def test_pairs_out_of_time_keep_their_answer():
    collisions, tips, sheet = scene(0.1, priority=-2)
    assert collisions.pair_settings(tips, sheet).priority == -2
    assert collisions.detect_collision() is True
    assert collisions.statistics().unfinished_pairs == []
    collisions.advance()
    collisions.set_positions(tips, np.array([[3, 3, 0.5]]))
    assert collisions.detect_collision(budget=0) is False
    (pair,) = collisions.statistics().unfinished_pairs
    assert (pair.a, pair.b, pair.age) == (tips, sheet, 1)
    assert pair.exceeds_budget is True  # it was the first, and there was no time
    assert 0.1 - 1e-9 < pair.distance_bound <= 0.1
    assert collisions.statistics().free_motion_unfinished is False
    data = collisions.collision_data(tips, sheet)
    assert len(data.vertex_triangle) == 1
    assert data.validity.reason is palpate.MethodReason.OUT_OF_TIME
    assert (data.validity.age, data.validity.trusted) == (1, False)
    assert collisions.detect_collision(math.inf) is True
    data = collisions.collision_data(tips, sheet)
    assert data.validity.age == 0
    with pytest.raises(palpate.Error, match="not a number"):
        collisions.detect_collision(math.nan)


def test_another_thread_cancels():
    collisions, tips, sheet = scene(0.1, method="proximity")
    second = collisions.add_point_set(np.array([[3, 3, 0.15]]))
    collisions.add_collision_pair(second, sheet, method="proximity", thickness=0.2)

    def predicate(features):
        thread = threading.Thread(target=collisions.cancel_detection)
        thread.start()
        thread.join()
        return True

    collisions.cancel_detection()  # nothing runs
    collisions.set_contact_predicate(tips, sheet, predicate)
    assert collisions.detect_collision(math.inf) is False
    assert collisions.detect_collision() is True
