"""While it runs: progress, exceptions, Ctrl-C, threads, the GIL."""

import multiprocessing
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import dmkcl

# Explicit steps with a tolerance that they reach after hours.
ENDLESS = dict(method="euler", dt=1e-3, tolerance=1e-14, max_steps=10**8)


def test_progress_function(solver):
    seen = []
    found = solver.solve(vertex=0, progress=seen.append)
    steps = [p for p in seen if p.stage == "solve"]
    assert [p.step for p in steps] == list(range(1, found.stats["steps"] + 1))
    assert steps[-1].change == found.stats["change"]


def test_exceptions_end_a_solve_and_pass(solver, result):
    class Enough(Exception):
        pass

    def stop(progress):
        if progress.step == 3:
            raise Enough

    with pytest.raises(Enough):
        solver.solve(vertex=0, progress=stop, **ENDLESS)
    assert np.array_equal(solver.solve(vertex=0).density, result.density)


@pytest.mark.parametrize(
    "again",
    [lambda s: s.solve(vertex=5), lambda s: dmkcl.CutLocus(s.mesh), lambda s: s.transport(np.ones(len(s.mesh.vertices)))],
)
def test_a_call_on_the_device_within_another_is_refused(again):
    """On another thread, for what is not refused waits for ever."""
    solver = dmkcl.CutLocus(dmkcl.surfaces.sphere(n_triangles=800))
    said = []

    def work():
        try:
            solver.solve(vertex=0, progress=lambda report: again(solver))
        except dmkcl.Error as error:
            said.append(str(error))

    worker = threading.Thread(target=work, daemon=True)
    worker.start()
    worker.join(60)
    assert said and "the device works for a call of this thread" in said[0]
    assert solver.solve(vertex=0).stats["steps"] > 0


def test_tqdm(solver, capsys):
    pytest.importorskip("tqdm")
    solver.solve(vertex=0, progress=True)
    assert "steps" in capsys.readouterr().err
    list(solver.solve_many(vertices=[0, 1], progress=True))
    assert "2/2" in capsys.readouterr().err


INTERRUPTED = """
import dmkcl
solver = dmkcl.CutLocus(dmkcl.surfaces.sphere(n_triangles=5000))
try:
    solver.solve(vertex=0, progress=lambda p: print("step", p.step, flush=True), **{options!r})
except KeyboardInterrupt:
    print("interrupted", flush=True)
print("again", solver.solve(vertex=0).stats["steps"], flush=True)
"""


def test_ctrl_c():
    code = INTERRUPTED.replace("{options!r}", repr(ENDLESS))
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        try:
            for line in child.stdout:
                if line.startswith("step 2"):
                    break
            child.send_signal(signal.SIGINT)
            out, err = child.communicate(timeout=60)
        finally:
            child.kill()
    assert "interrupted" in out and "again" in out and err == "" and child.returncode == 0


def test_threads_get_the_same_results(solver, small):
    other = dmkcl.CutLocus(small)
    jobs = [(s, v) for v in (0, 5, 9) for s in (solver, other)]

    def outcome(s, v):
        found = s.solve(vertex=v)
        return [*found.distance, found.locus.length]

    wanted = [outcome(s, v) for s, v in jobs]
    got = [None] * len(jobs)

    def work(i):
        got[i] = outcome(*jobs[i])

    threads = [threading.Thread(target=work, args=(i,)) for i in range(len(jobs))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(a, b) for a, b in zip(got, wanted))


def in_worker(solver, vertex):
    return solver.solve(vertex=vertex).distance


def in_fork():
    return in_worker(dmkcl.CutLocus(dmkcl.surfaces.sphere(n_triangles=800)), 0)


def test_workers_are_spawned_with_pickled_solvers(solver, result):
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        found = pool.submit(in_worker, solver, 0).result(timeout=120)
    assert np.array_equal(found, result.distance)


def solve_in_worker(path):
    (found,) = dmkcl.solve_meshes([path], on_error="yield")
    return found


@pytest.mark.parametrize("kind", ["multiprocessing", "futures"])
def test_results_and_errors_come_back_from_spawned_workers(kind, small, tmp_path):
    """By the ordinary calls: map of a Pool and of a ProcessPoolExecutor."""
    small.write(tmp_path / "a.off")
    (tmp_path / "b.off").write_text("no mesh")
    names = [str(tmp_path / "a.off"), str(tmp_path / "b.off")]
    spawn = multiprocessing.get_context("spawn")
    if kind == "multiprocessing":
        with spawn.Pool(1) as pool:
            found, error = pool.map(solve_in_worker, names)
    else:
        with ProcessPoolExecutor(1, mp_context=spawn) as pool:
            found, error = pool.map(solve_in_worker, names)
    here = solve_in_worker(names[0])
    assert np.array_equal(found.distance, here.distance)
    assert np.array_equal(found.density, here.density)
    assert found.locus.length == here.locus.length
    assert found.certificate == here.certificate
    assert isinstance(error, dmkcl.FormatError) and "b.off" in str(error)


def test_forked_workers_are_told(solver):
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool:
        with pytest.raises(dmkcl.DeviceError, match="spawn"):
            pool.submit(in_fork).result(timeout=120)


def test_the_gil_is_free_during_a_call():
    """Another thread gets on in the middle of one long call of the library."""
    span, moments = [], []

    def work():
        span.append(time.monotonic())
        dmkcl.surfaces.quartic(n_triangles=30000)
        span.append(time.monotonic())

    worker = threading.Thread(target=work)
    worker.start()
    while worker.is_alive():
        moments.append(time.monotonic())
        time.sleep(0.001)
    quarter = (span[1] - span[0]) / 4
    assert sum(span[0] + quarter < m < span[1] - quarter for m in moments) >= 3
