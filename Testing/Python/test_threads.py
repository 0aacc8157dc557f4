"""The GIL: long calls release it, predicates take it, nothing deadlocks."""

import pathlib
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import palpate
from scenes import BLADE_MOVED, Balls, Cut, ball


def run_with_limit(*functions):
    """Runs functions on threads of their own; fails if one does not return, or raises."""
    errors = []

    def guarded(function):
        try:
            function()
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=guarded, args=[f], daemon=True) for f in functions]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
        assert not thread.is_alive(), "a thread waits for ever"
    if errors:
        raise errors[0]


class Ticks:
    """Counts how often a thread of Python runs while others compute."""

    def __enter__(self):
        self.count, self.done = 0, False
        self.thread = threading.Thread(target=self.tick, daemon=True)
        self.thread.start()
        return self

    def tick(self):
        while not self.done:
            self.count += 1
            time.sleep(0.0005)

    def __exit__(self, *arguments):
        self.done = True
        self.thread.join(timeout=60)


def longest(function, seconds=0.1):
    """Ticks of another thread in one call that takes long, made from many by `function`."""
    switch = sys.getswitchinterval()
    sys.setswitchinterval(10)  # without a release, another thread would wait until the end
    try:
        with Ticks() as ticks:
            while ticks.count < 2:
                time.sleep(0.001)
            before, start = ticks.count, time.perf_counter()
            function()
            elapsed, ran = time.perf_counter() - start, ticks.count - before
    finally:
        sys.setswitchinterval(switch)
    assert elapsed > seconds / 4, "the call is too short to tell"
    return ran


def big_frame():
    positions, triangles = ball(150)
    collisions = palpate.OctreeBasedCD(engine="octree", threads=1)
    a = collisions.add_triangle_mesh(positions, triangles)
    b = collisions.add_triangle_mesh(positions + [0.001, 0, 0], triangles)
    collisions.add_collision_pair(a, b, method="proximity", thickness=0.01)
    return collisions, a, b


def test_a_frame_releases_the_gil():
    collisions, a, b = big_frame()
    assert longest(collisions.detect_collision) > 5
    assert len(collisions.collision_data(a, b).edge_edge) > 0


def test_batches_of_queries_release_the_gil():
    positions, triangles = ball(50)
    collisions = palpate.OctreeBasedCD(threads=1)
    mesh = collisions.add_triangle_mesh(positions, triangles)
    queries = collisions.queries()
    points = np.random.default_rng(1).normal(size=(200_000, 3))
    assert longest(lambda: queries.closest_points(mesh, points)) > 5
    assert longest(lambda: queries.signed_distances(mesh, points)) > 5
    assert longest(lambda: queries.contains(mesh, points)) > 5
    assert longest(lambda: queries.first_hits(mesh, 3 * points, -points), 0.01) > 0


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_predicates_on_any_thread(threads):
    positions, triangles = ball(30)
    collisions = palpate.OctreeBasedCD(threads=threads)
    a = collisions.add_triangle_mesh(positions, triangles)
    b = collisions.add_triangle_mesh(positions + [1.9, 0, 0], triangles)
    collisions.add_collision_pair(a, b, method="proximity", thickness=0.1)
    collisions.detect_collision()
    everything = collisions.collision_data(a, b)
    called = set()

    def accept(features):
        called.add(threading.get_ident())
        assert isinstance(features.kind, palpate.ContactFeaturesKind)
        return features.kind != palpate.ContactFeaturesKind.EDGE_EDGE

    collisions.set_contact_predicate(a, b, accept)
    run_with_limit(collisions.detect_collision)
    data = collisions.collision_data(a, b)
    assert called and len(data.edge_edge) == 0 < len(everything.edge_edge)
    assert len(data.vertex_triangle) > 0


@pytest.mark.parametrize("threads", [1, 4])
def test_exceptions_of_predicates_come_out(threads):
    class Refused(Exception):
        pass

    def refuse(features):
        raise Refused("no")

    scene = Balls(rows=30, threads=threads)
    expected = scene.step(30)
    scene.collisions.set_contact_predicate(scene.a, scene.b, refuse)
    with pytest.raises(Refused, match="no"):
        run_with_limit(scene.collisions.detect_collision)
    assert scene.collisions.collision_data(scene.a, scene.b) == expected  # the last answer
    scene.collisions.set_contact_predicate(scene.a, scene.b, None)
    scene.collisions.detect_collision()

    class NoTruth:
        def __bool__(self):
            raise Refused("no truth")

    scene.collisions.set_contact_predicate(scene.a, scene.b, lambda features: NoTruth())
    with pytest.raises(Refused, match="no truth"):
        scene.collisions.detect_collision()
    with pytest.raises(Refused):
        scene.collisions.for_each_candidate(scene.a, scene.b, refuse)


def test_a_predicate_cannot_call_the_object_at_work():
    scene = Cut()
    codes = []

    def call_back(features):
        for call in (
            scene.collisions.detect_collision,
            scene.collisions.statistics,
            scene.collisions.queries,
            lambda: scene.collisions.positions(scene.blade),
            lambda: scene.collisions.remove_geometry(scene.blade),
        ):
            with pytest.raises(palpate.Error) as caught:
                call()
            codes.append(caught.value.code)
        assert "at work" in repr(scene.collisions)
        scene.collisions.latest_snapshot()  # always allowed
        return True

    scene.collisions.set_contact_predicate(scene.blade, scene.organ, call_back)
    run_with_limit(scene.detect)
    assert codes and set(codes) == {palpate.ErrorCode.INVALID_CALL}
    scene.collisions.set_positions(scene.blade, BLADE_MOVED)


def test_two_objects_run_at_the_same_time():
    inside, both = threading.Barrier(2, timeout=30), []

    def frames():
        scene = Cut()

        def meet(features):
            if not both or threading.get_ident() not in both:
                both.append(threading.get_ident())
                inside.wait()  # the frame of the other thread has to be inside, too
            return True

        scene.collisions.set_contact_predicate(scene.blade, scene.organ, meet)
        data = scene.detect()
        assert len(data.vertex_triangle) == 1

    run_with_limit(frames, frames)
    assert len(both) >= 2


def test_two_objects_that_share_an_executor():
    executor = palpate.make_thread_pool(2)

    def frames():
        scene = Balls(rows=30, executor=executor)
        hashes = [scene.step(number).hash() for number in range(20)]
        alone = Balls(rows=30, threads=1)
        assert hashes == [alone.step(number).hash() for number in range(20)]

    run_with_limit(frames, frames, frames)


def test_predicates_of_objects_that_share_an_executor():
    executor = palpate.make_thread_pool(3)

    def frames():
        scene = Balls(rows=16, executor=executor)
        refuse = palpate.ContactFeaturesKind.EDGE_EDGE
        scene.collisions.set_contact_predicate(scene.a, scene.b, lambda f: f.kind != refuse)
        for number in range(10):
            data = scene.step(number)
            near = scene.collisions.queries().closest_points(scene.a, scene.positions)
            assert len(data.edge_edge) == 0 and len(near) == len(scene.positions)

    run_with_limit(frames, frames, frames)


def test_another_thread_at_work_on_the_same_object():
    collisions, a, b = big_frame()
    refused = []

    def try_to_read():
        for _ in range(200):
            try:
                collisions.positions(a)
            except palpate.Error as error:
                refused.append(error.code)
            time.sleep(0.0005)

    run_with_limit(collisions.detect_collision, try_to_read)
    assert set(refused) <= {palpate.ErrorCode.INVALID_CALL}
    assert len(collisions.positions(a)) > 0


def test_snapshots_are_read_while_frames_run():
    scene = Balls(rows=20)
    scene.step(0)
    scene.collisions.publish(0)
    done = threading.Event()

    def simulate():
        for number in range(100):
            scene.step(number)
            scene.collisions.publish(number)
        done.set()

    def read():
        numbers = []
        while not done.is_set():
            snapshot = scene.collisions.latest_snapshot()
            numbers.append(snapshot.number)
            positions = snapshot.positions(scene.b)
            point = positions[0] + [0, 0, 0.25]
            near = snapshot.queries().closest_point(scene.b, point)
            assert near.distance == pytest.approx(0.25, abs=1e-9)
        assert numbers == sorted(numbers)

    run_with_limit(simulate, read, read)


def test_progress_that_ends_a_build():
    positions, triangles = ball(20)
    fractions = []

    def stop(fraction):
        fractions.append(fraction)
        return len(fractions) < 3

    with pytest.raises(palpate.Error) as caught:
        palpate.DistanceField.build(
            positions, triangles, error_bound=1e-3, band=0.5, progress=stop
        )
    assert caught.value.code is palpate.ErrorCode.CANCELLED
    assert len(fractions) == 3 and fractions == sorted(fractions)

    def fail(fraction):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        palpate.DistanceField.build(
            positions, triangles, error_bound=1e-2, band=0.5, progress=fail
        )


def test_the_interpreter_ends_with_objects_alive():
    code = """
import palpate, threading
from scenes import Cut
scene = Cut()
scene.collisions.set_contact_predicate(scene.blade, scene.organ, lambda features: True)
scene.detect()
scene.collisions.publish()
kept = scene.collisions.latest_snapshot(), scene.collisions.queries(), palpate.make_thread_pool(2)
print("end")
"""
    run = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=pathlib.Path(__file__).parent,
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, "end\n", "")
