#!/usr/bin/python3
"""Draws the force on a vertex that slides over a coarse sphere: smoothNormals.py CSV PICTURE writes PICTURE.svg.

smoothNormals.py --measure CSV writes the CSV; it needs the Python package of this library.
"""
import csv
import math
import sys

from chartStyle import BLACK, BLUE, VERMILLION, plt, read, save

RINGS, SEGMENTS, THICKNESS, HEIGHT, STIFFNESS = 7, 8, 0.2, 1.02, 10.0  # L, the radius is 1; force / L
STEPS = 720


def sphere(numpy):
    """Positions and triangles of latitudes by longitudes."""
    angles = [(math.pi * r / RINGS, 2 * math.pi * s / SEGMENTS) for r in range(1, RINGS) for s in range(SEGMENTS)]
    positions = [(0, 0, 1)] + [(math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)) for t, p in angles] + [(0, 0, -1)]
    bottom = len(positions) - 1

    def at(r, s):
        return 1 + (r - 1) * SEGMENTS + s % SEGMENTS
    triangles = []
    for s in range(SEGMENTS):
        triangles += [(0, at(1, s), at(1, s + 1)), (bottom, at(RINGS - 1, s + 1), at(RINGS - 1, s))]
        for r in range(1, RINGS - 1):
            triangles += [(at(r, s), at(r + 1, s), at(r + 1, s + 1)), (at(r, s), at(r + 1, s + 1), at(r, s + 1))]
    return numpy.array(positions), numpy.array(triangles)


def measure(path):
    import numpy
    import palpate
    collisions = palpate.OctreeBasedCD()
    u, v = numpy.array([1, 0.3, 0.2]), numpy.array([-0.3, 1, 0.8])
    u /= numpy.linalg.norm(u)
    v -= v @ u * u
    v /= numpy.linalg.norm(v)
    ball, tip = collisions.add_triangle_mesh(*sphere(numpy)), collisions.add_point_set(HEIGHT * u[None])
    collisions.add_collision_pair(tip, ball, method="proximity", thickness=THICKNESS, smooth_normals=True)
    with open(path, "w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["degrees", "contact", "smooth"])
        for i in range(STEPS + 1):
            angle = 2 * math.pi * i / STEPS
            outward, along = math.cos(angle) * u + math.sin(angle) * v, math.cos(angle) * v - math.sin(angle) * u
            collisions.set_positions(tip, HEIGHT * outward[None])
            collisions.detect_collision()
            data = collisions.collision_data(tip, ball)
            nearest = data.vertex_triangle["distance"].argmin()
            force = STIFFNESS * (THICKNESS - data.vertex_triangle["distance"][nearest])
            normals = data.vertex_triangle["normal"][nearest], data.smooth_vertex_triangle[nearest]
            rows.writerow([f"{360 * i / STEPS:g}"] + [f"{force * (normal @ along):.4f}" for normal in normals])


def main(source, picture):
    rows = read(source)
    figure, axes = plt.subplots(figsize=(8.3, 2.9))
    figure.subplots_adjust(left=0.09, right=0.98, top=0.88, bottom=0.18)
    degrees = [row["degrees"] for row in rows]
    axes.axhline(0, color=BLACK, linewidth=0.8)
    for name, label, colour in (("contact", "along the contact's normal", BLUE), ("smooth", "along the smooth normal", VERMILLION)):
        axes.plot(degrees, [row[name] for row in rows], color=colour, linewidth=1.6, label=label)
    axes.set_xlim(0, 360)
    axes.set_ylim(-0.75, 1.0)
    axes.set_xticks(range(0, 361, 60), [f"{x}°" for x in range(0, 361, 60)])
    axes.set_xlabel("place on a great circle of the sphere", fontsize=11)
    axes.set_ylabel("force along the path", fontsize=11)
    axes.tick_params(labelsize=10)
    axes.grid(True)
    axes.set_axisbelow(True)
    axes.legend(loc="upper right", fontsize=10, ncol=2, framealpha=0.9)
    axes.set_title("A vertex slides over a coarse sphere without friction", loc="left", fontsize=12)
    save(figure, picture)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    if sys.argv[1] == "--measure":
        measure(sys.argv[2])
    else:
        main(*sys.argv[1:])
