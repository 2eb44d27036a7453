"""Runs of the tool that are interrupted at random moments, as Ctrl-C does it or as kill does.
usage: interrupts.py TOOL RUNS [SEED]
Each ends within a second with exit code 130, or it was done before; what it has written is whole, and nothing
else is left. Some runs begin with an empty cache of kernels, and some read a pipe that nobody writes to or a
gigabyte of zeros. Prints what fails, and at last "# tried N: failed M"."""
import glob
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

LIMIT = 1.0  # seconds, on a machine that has nothing else to do


def load():
    """How many times longer than on an idle machine things may take now."""
    return max(1.0, 2 * os.getloadavg()[0] / (os.cpu_count() or 1))


def commands(work, tool):
    mesh, big = f"{work}/torus.off", f"{work}/large.off"
    for name, triangles in ((mesh, 1200), (big, 30000)):
        subprocess.run([tool, "mesh", "torus", "--triangles", str(triangles), "--quiet", "--out", name], check=True)
    with open(f"{work}/list.txt", "w") as file:
        file.write("".join(f"vertex {k}\n" for k in range(300)))
    with open(f"{work}/zeros.off", "wb") as file:
        file.truncate(1 << 30)
    os.mkfifo(f"{work}/pipe.off")
    outs = ["--out", "OUT/a.vtp", "--locus", "OUT/b.obj", "--tangent", "OUT/c.csv", "--report", "OUT/d.json"]
    return {
        "solve": ["solve", mesh, "--vertex", "0", "--quiet", *outs],
        "large": ["solve", big, "--vertex", "0", "--quiet", *outs],
        "cut": ["cut", mesh, "--vertex", "0", "--quiet", "--out", "OUT/e.ply"],
        "path": ["path", mesh, "--vertex", "0", "--to-vertex", "100", "--out", "OUT/f.vtp"],
        "many": ["solve", mesh, "--sources", f"{work}/list.txt", "--out", "OUT/g.vtu", "--report", "OUT/h.json"],
        "mesh": ["mesh", "torus", "--triangles", "60000", "--quiet", "--out", "OUT/i.off"],
        "info": ["info", big],
        "devices": ["devices"],
        "pipe": ["solve", f"{work}/pipe.off", "--vertex", "0", "--out", "OUT/a.vtp"],
        "zeros": ["info", f"{work}/zeros.off"],
    }


def whole(path):
    """By its last bytes; those of OBJ and CSV end with a line."""
    with open(path, "rb") as file:
        end = file.read()[-40:]
    last = {"vtp": b"</VTKFile>\n", "vtu": b"</VTKFile>\n", "json": b"}\n"}.get(path.rsplit(".", 1)[1], None)
    return end.endswith(last) if last else len(end) > 0 and (end.endswith(b"\n") or path.endswith(".ply"))


def one_run(tool, command, delay, number, group, environment, out):
    """What went wrong, or ""; and the seconds between the signal and the end."""
    # Signals that this program was started to ignore, the tool would, too.
    command = ["env", "--default-signal=INT,TERM", tool, *[a.replace("OUT", out) for a in command]]
    process = subprocess.Popen(command, env=environment,
                               stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                               start_new_session=True)
    time.sleep(delay)
    allowed = LIMIT * load()
    begin = time.monotonic()
    try:
        (os.killpg if group else os.kill)(process.pid, number)
    except ProcessLookupError:
        pass
    try:
        text = process.communicate(timeout=30)[1].decode(errors="replace")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return "goes on", 30.0
    took = time.monotonic() - begin
    early = process.returncode == -number  # in the loader: before there is a line of ours
    if process.returncode not in (0, 130) and not (early and delay < 0.05 * load()):
        return f"exit {process.returncode}: {text}", took
    if process.returncode == 130 and text.replace("\r\033[K", "").count("\n") != 1:
        return f"not one line: {text}", took
    for path in glob.glob(out + "/.*") + glob.glob(out + "/*"):
        if os.path.basename(path).startswith(".") or not whole(path):
            return f"left {path}", took
    if took > allowed:
        return f"took {took:.2f} s, load {load():.1f}", took
    return "", took


def main():
    tool, runs = os.path.abspath(sys.argv[1]), int(sys.argv[2])
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 17
    chance = random.Random(seed)
    work = tempfile.mkdtemp()
    failed, slowest = 0, 0.0
    try:
        known = commands(work, tool)
        environment = dict(os.environ, TMPDIR=f"{work}/tmp", POCL_CACHE_DIR=f"{work}/warm")
        os.mkdir(f"{work}/tmp")
        subprocess.run([tool, *[a.replace("OUT", work) for a in known["solve"]]], env=environment, check=True)
        for run in range(runs):
            name = chance.choice(list(known))
            cold = name in ("solve", "cut", "path", "many") and chance.random() < 0.3
            out = f"{work}/out"
            os.mkdir(out)
            environment["POCL_CACHE_DIR"] = f"{work}/cold" if cold else f"{work}/warm"
            number = chance.choice((signal.SIGINT, signal.SIGTERM))
            # Most of what may go wrong does so in the first half second.
            delay = chance.choice((0.3, 0.3, 1, 8 if cold else 2)) * chance.random()
            wrong, took = one_run(tool, known[name], delay, number, chance.random() < 0.5, environment, out)
            slowest = max(slowest, took)
            if os.listdir(f"{work}/tmp"):
                wrong = wrong or f"left in TMPDIR: {os.listdir(work + '/tmp')}"
                shutil.rmtree(f"{work}/tmp")
                os.mkdir(f"{work}/tmp")
            if wrong:
                failed += 1
                print(f"FAILED: run {run} (seed {seed}): {name}{' cold' if cold else ''}, "
                      f"{number.name} after {delay:.3f} s: {wrong}", flush=True)
            shutil.rmtree(out)
            shutil.rmtree(f"{work}/cold", ignore_errors=True)
    finally:
        shutil.rmtree(work)
    print(f"slowest end {slowest:.2f} s")
    print(f"# tried {runs}: failed {failed}")
    return failed > 0


if __name__ == "__main__":
    sys.exit(main())
