"""Compares calls from NumPy to NumPy with the same calls in C++. Not a test: it prints times.

    cmake --build build/release --target PalpatePythonBaseline
    PYTHONPATH=build/release/Python /usr/bin/python3 Testing/Python/benchmark.py \
        build/release/Testing/Python/libPalpatePythonBaseline.so

Python and C++ take turns, frame by frame, in one process and on the same library.
"""

import ctypes
import statistics
import sys
import time

import numpy as np

import palpate

ROUNDS = 5  # over all frames of the scene
BATCHES = 7
POINTS = 1_000_000


def load(path):
    baseline = ctypes.CDLL(path)
    for name in ("runFrame", "runClosestPoints", "thickness"):
        getattr(baseline, name).restype = ctypes.c_double
    baseline.runClosestPoints.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p]
    for name in ("copyFrame", "copyTriangles", "copyPair"):
        getattr(baseline, name).argtypes = None
    return baseline


def array_of(function, shape, dtype, *arguments):
    array = np.empty(shape, dtype=dtype)
    function(*arguments, ctypes.c_void_p(array.ctypes.data))
    return array


class Loop:
    """The scene of the C++ loop, in Python."""

    def __init__(self, baseline, threads):
        meshes = range(baseline.meshCount())
        self.frames = [
            [
                array_of(baseline.copyFrame, (baseline.vertexCount(m), 3), np.float64, f, m)
                for m in meshes
            ]
            for f in range(baseline.frameCount())
        ]
        triangles = [
            array_of(baseline.copyTriangles, (baseline.triangleCount(m), 3), np.uint32, m)
            for m in meshes
        ]
        self.collisions = palpate.OctreeBasedCD(threads=threads)
        self.ids = [
            self.collisions.add_triangle_mesh(positions, t)
            for positions, t in zip(self.frames[0], triangles, strict=True)
        ]
        pairs = range(baseline.pairCount())
        indices = [array_of(baseline.copyPair, 2, np.uint32, pair) for pair in pairs]
        self.pairs = [(self.ids[a], self.ids[b]) for a, b in indices]
        for a, b in self.pairs:
            self.collisions.add_collision_pair(
                a, b, method="proximity", thickness=baseline.thickness()
            )

    def run_frame(self, frame):
        start = time.perf_counter()
        for mesh, positions in zip(self.ids, self.frames[frame], strict=True):
            self.collisions.set_positions(mesh, positions)
        self.collisions.detect_collision()
        lists = []
        for a, b in self.pairs:
            data = self.collisions.collision_data(a, b)
            lists += [data.vertex_triangle, data.triangle_vertex, data.edge_edge]
        seconds = time.perf_counter() - start
        self.collisions.advance()
        return seconds, sum(map(len, lists))

    def run_closest_points(self, points):
        queries = self.collisions.queries()
        start = time.perf_counter()
        near = queries.closest_points(self.ids[0], points)
        return time.perf_counter() - start, near["distance"].sum()


def report(name, unit, scale, python, cpp):
    ratio = statistics.median(p / c for p, c in zip(python, cpp, strict=True))
    print(
        f"{name}: C++ {scale * statistics.median(cpp):.3f} {unit}, Python "
        f"{scale * statistics.median(python):.3f} {unit}, median of the ratios {ratio:.3f}"
    )


def main():
    baseline = load(sys.argv[1])
    for threads in (1, 2):
        baseline.makeLoop(threads)
        loop = Loop(baseline, threads)
        python, cpp, contacts = [], [], ctypes.c_size_t()
        for number in range(ROUNDS * len(loop.frames)):
            frame = number % len(loop.frames)
            for turn in (0, 1) if number % 2 else (1, 0):
                if turn:
                    seconds, found = loop.run_frame(frame)
                    python.append(seconds)
                else:
                    cpp.append(baseline.runFrame(frame, ctypes.byref(contacts)))
            assert found == contacts.value
        skip = len(loop.frames)  # the first round warms up
        report(f"frame of the organs, {threads} threads", "ms", 1e3, python[skip:], cpp[skip:])

        low, high = loop.frames[0][0].min(axis=0), loop.frames[0][0].max(axis=0)
        points = np.random.default_rng(1).uniform(low, high, size=(POINTS, 3))
        python, cpp, total = [], [], ctypes.c_double()
        for _ in range(BATCHES):
            seconds, found = loop.run_closest_points(points)
            python.append(seconds)
            cpp.append(baseline.runClosestPoints(points.ctypes.data, POINTS, ctypes.byref(total)))
            assert abs(found - total.value) < 1e-6 * found
        report(f"{POINTS} closest points, {threads} threads", "ms", 1e3, python[1:], cpp[1:])


if __name__ == "__main__":
    main()
