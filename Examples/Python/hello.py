"""A blade moves down through the surface of an organ in one step. Lengths are in mm."""

import numpy as np

import palpate

organ = np.array([[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, -30]], dtype=float)
blade = np.array([[5, 5, 1], [5, -9, 8], [5, 9, 8]], dtype=float)

collisions = palpate.OctreeBasedCD()
a = collisions.add_triangle_mesh(blade, [[0, 1, 2]])
b = collisions.add_triangle_mesh(organ, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
collisions.add_collision_pair(a, b, method="continuous", thickness=0.5)
collisions.set_positions(a, blade, blade - [0, 0, 4])  # both ends of the step
collisions.detect_collision()

contacts = collisions.collision_data(a, b)
for c in contacts.vertex_triangle:
    print(f"vertex {c.vertex} meets triangle {c.triangle} at time {c.time_of_impact:.3f}")
print(contacts)
