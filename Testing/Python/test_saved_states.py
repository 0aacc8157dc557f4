"""save() and restore()."""

import numpy as np
import pytest

import palpate

CORNERS = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0]], float)


def test_a_restored_state_continues_with_the_same_bits():
    collisions = palpate.OctreeBasedCD()
    sheet = collisions.add_triangle_mesh(CORNERS, np.array([[0, 1, 2]]))
    tip = collisions.add_point_set(np.array([[3.0, 3, 1]]))
    collisions.add_collision_pair(tip, sheet, method="proximity", thickness=0.5, track_contacts=True)

    def move(each, height):
        each.set_positions(tip, np.array([[3, 3, height]]))
        each.detect_collision()
        data = each.collision_data(tip, sheet)
        answer = (data.hash(), str(data.tracked_vertex_triangle), str(data.ended))
        each.advance()
        return answer

    move(collisions, 0.2)
    state = collisions.save()
    assert isinstance(state, bytes)
    truth = [move(collisions, height) for height in (0.3, 0.9, 0.1)]
    collisions.restore(state)
    assert collisions.save() == state
    assert [move(collisions, height) for height in (0.3, 0.9, 0.1)] == truth
    other = palpate.OctreeBasedCD()
    other.restore(state)
    assert [move(other, height) for height in (0.3, 0.9, 0.1)] == truth
    with pytest.raises(palpate.Error, match="saved state, byte"):
        other.restore(state[:-1])
