#!/usr/bin/env python3
"""Whole runs, from a mesh file to the result, of dmkcl beside its peers, on one machine.

usage: bench.py [quick|usual|full] [--program DMKCL] [--work build/bench] [--results bench/results]
Every run is a process of its own: wall time from its start to its end, peak memory as the system
reports it (ru_maxrss). Programs take turns on a mesh; the least of several rounds counts. dmkcl solves,
certifies and writes the cut locus; `distance` is `dmkcl distance`, which like the peers gives a
distance only and writes nothing. Kernel caches are
warm; one cold run stands beside. A MB is 10^6 bytes. `quick` is one surface up to 270k triangles;
`usual` leaves most of the heat method at 1.08M triangles out, a minute or more a run; `full` has all. `make bench` installs the peers beside the build; the real meshes come
from Debian's package libcgal-demo. Writes bench.csv and bench.md.
"""
import argparse
import csv
import json
import math
import os
import shutil
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
OWN = ["dmkcl", "distance"]
PEERS = ["heat_robust", "heat_plain", "fast_marching", "exact"]
EXACT_LIMIT = 90_000  # triangles: beyond, the exact distance needs minutes and gigabytes
# Surface, source, triangles of the coarse mesh (None: the default), refinements for the five sizes.
SURFACES = {
    "torus": ("3,0,0", 4220, [0, 1, 2, 3, 4]),
    "ellipsoid": ("-0.151128,-0.350718,0.295520", None, [1, 2, 3, 4, 5]),
    "quartic": ("0.533843,0.800764,0.844080", None, [0, 1, 2, 3, 4, 5]),
}
SIZES = ["5k", "20k", "70k", "270k", "1.08M", "4.3M"]
ALONE = 2_000_000  # triangles: beyond, only `dmkcl distance` is run
REAL = ["bunny00", "armadillo", "refined_elephant"]


def text_of(*command):
    return subprocess.run(command, capture_output=True, text=True).stdout.strip()


class Bench:
    def __init__(self, o):
        self.o = o
        self.rows = []
        self.meshes = {}  # name -> (path, source vertex, triangles)
        self.reports = {}  # name -> reports of dmkcl, one a round
        os.makedirs(o.work, exist_ok=True)
        os.makedirs(o.results, exist_ok=True)
        self.cache = os.path.abspath(f"{o.work}/cache")
        self.env = dict(os.environ, XDG_CACHE_HOME=self.cache, POCL_CACHE_DIR=self.cache + "/pocl")
        self.commit = text_of("git", "-C", HERE, "rev-parse", "--short", "HEAD") or "unknown"
        self.date = time.strftime("%Y-%m-%d")
        self.device = self.driver = ""

    # ---- meshes ----

    def add(self, name, path, vertex=0):
        with open(path) as f:
            tokens = []
            while len(tokens) < 3:
                tokens += f.readline().split("#")[0].replace("OFF", " ").split()
        self.meshes[name] = (path, vertex, int(tokens[1]))

    def surface(self, surface, k):
        source, coarse, refine = SURFACES[surface]
        name = f"{surface}_{SIZES[k]}"
        path = f"{self.o.work}/{name}.off"
        if not os.path.exists(path):
            more = ["--triangles", str(coarse)] if coarse else []
            subprocess.run([self.o.program, "mesh", surface, "--refine", str(refine[k]), "--source",
                            source, "--out", path, "--quiet", *more], check=True)
        self.add(name, path)

    def symmetric_torus(self, n=452, m=96):
        """A structured grid: its distances have ties everywhere, which exact methods pay for."""
        path = f"{self.o.work}/torus_symmetric_87k.off"
        if not os.path.exists(path):
            with open(path + ".tmp", "w") as f:
                f.write(f"OFF\n{n * m} {2 * n * m} 0\n")
                for i in range(n):
                    for j in range(m):
                        a, b = 2 * math.pi * i / n, 2 * math.pi * j / m
                        r = 2 + math.cos(b)
                        f.write(f"{r * math.cos(a)!r} {r * math.sin(a)!r} {math.sin(b)!r}\n")
                for i in range(n):
                    for j in range(m):
                        p, q = i * m + j, (i + 1) % n * m + j
                        r, s = i * m + (j + 1) % m, (i + 1) % n * m + (j + 1) % m
                        f.write(f"3 {p} {q} {s}\n3 {p} {s} {r}\n")
            os.rename(path + ".tmp", path)
        self.add("torus_symmetric_87k", path)

    def real_meshes(self):
        there = f"{self.o.work}/real"
        try:
            if not all(os.path.exists(f"{there}/{m}.off") for m in REAL):
                os.makedirs(there, exist_ok=True)
                if not [f for f in os.listdir(there) if f.endswith(".deb")]:
                    subprocess.run(["apt-get", "download", "libcgal-demo"], cwd=there, check=True,
                                   capture_output=True)
                deb = [f for f in os.listdir(there) if f.endswith(".deb")][0]
                subprocess.run(["dpkg", "-x", deb, "x"], cwd=there, check=True)
                subprocess.run(["tar", "xzf", "x/usr/share/doc/libcgal-dev/data.tar.gz",
                                "--strip-components=2", "data/meshes"], cwd=there, check=True)
            for m in REAL:
                self.add(m, f"{there}/{m}.off")
        except (OSError, IndexError, subprocess.CalledProcessError) as e:
            print(f"no real meshes (Debian's libcgal-demo cannot be had: {e})", flush=True)

    # ---- runs ----

    def run(self, command):
        """(seconds, megabytes, exit code) of one process."""
        start = time.perf_counter()
        child = subprocess.Popen(command, env=self.env, stdout=subprocess.DEVNULL,
                                 stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(child.pid, 0)
        seconds = time.perf_counter() - start
        child.returncode = os.waitstatus_to_exitcode(status)
        return seconds, usage.ru_maxrss * 1024 / 1e6, child.returncode

    def dmkcl(self, name, *more):
        path, vertex, _ = self.meshes[name]
        report = f"{self.o.work}/report.json"
        run = self.run([self.o.program, "solve", path, "--vertex", str(vertex), "--quiet", "--report",
                        report, "--locus", f"{self.o.work}/locus.obj", *more])
        if run[2] == 0:
            with open(report) as f:
                r = json.load(f)
            self.device, self.driver = r["device"]["name"], r["device"]["driver"]
            self.reports.setdefault(name, []).append(r)
        return run

    def one(self, name, program):
        path, vertex, _ = self.meshes[name]
        if program == "dmkcl":
            return self.dmkcl(name)
        if program == "distance":
            return self.run([self.o.program, "distance", path, "--vertex", str(vertex), "--quiet"])
        return self.run([sys.executable, f"{HERE}/peers.py", program, path, str(vertex)])

    def measure(self, name, peers, rounds, peer_rounds):
        runs = {p: [] for p in (["distance"] if self.meshes[name][2] > ALONE else [*OWN, *peers])}
        for k in range(rounds):
            for p, got in runs.items():
                if (p in OWN or k < peer_rounds) and (p != "exact" or k == 0):
                    got.append(self.one(name, p))
        for p, got in runs.items():
            good = [r for r in got if r[2] == 0]
            self.record(name, p, good, got[-1][2])

    def record(self, name, program, runs, code=0):
        seconds = min((r[0] for r in runs), default=math.nan)
        memory = min((r[1] for r in runs), default=math.nan)
        self.rows.append(dict(mesh=name, triangles=self.meshes[name][2], program=program,
                              seconds=f"{seconds:.3f}", megabytes=f"{memory:.0f}", runs=len(runs)))
        note = "" if runs else f"  failed with exit code {code}"
        print(f"{name:22} {self.meshes[name][2]:>8}  {program:14} {seconds:8.3f} s {memory:6.0f} MB"
              f"  of {len(runs)}{note}", flush=True)

    def cold(self, name):
        shutil.rmtree(self.cache, ignore_errors=True)
        self.record(name, "dmkcl cold", [self.dmkcl(name)])
        del self.reports[name]

    def next_sources(self, name):
        """Seconds of the first and of each next source in one run over several."""
        if "--sources" not in text_of(self.o.program, "solve", "--help"):
            return None
        path, _, n = self.meshes[name]
        listed = f"{self.o.work}/sources.txt"
        out = {}
        for count in (1, 5):
            with open(listed, "w") as f:
                f.writelines(f"vertex {k * (n // 12)}\n" for k in range(count))
            runs = [self.run([self.o.program, "solve", path, "--sources", listed, "--quiet", "--locus",
                              f"{self.o.work}/many.obj"]) for _ in range(2)]
            if any(r[2] for r in runs):
                print(f"--sources failed with exit code {runs[0][2]}", flush=True)
                return None
            out[count] = min(r[0] for r in runs)
        return out[1], (out[5] - out[1]) / 4

    def distance_error(self, name):
        """Largest error of the distance against pygeodesic, over the largest distance."""
        path, vertex, _ = self.meshes[name]
        out = f"{self.o.work}/distance.ply"
        subprocess.run([self.o.program, "distance", path, "--vertex", str(vertex), "--quiet", "--out", out], check=True)
        return float(text_of(sys.executable, f"{HERE}/peers.py", "compare", path, str(vertex), out))

    def merged_error(self, name):
        """Merged windows against exact ones: (largest, 99 %) of the error over the largest distance."""
        import numpy as np

        path, vertex, _ = self.meshes[name]
        got = []
        for how in ([], ["--exact"]):
            out = f"{self.o.work}/distance.ply"
            subprocess.run([self.o.program, "distance", path, "--vertex", str(vertex), "--quiet", "--out", out, *how],
                           check=True)
            with open(out) as f:
                head = f.readline()
                while not head.endswith("end_header\n"):
                    head += f.readline()
                n = int(head.split("element vertex ")[1].split()[0])
                got.append(np.loadtxt(f, usecols=3, max_rows=n))
        error = np.abs(got[0] - got[1]) / got[1].max()
        return error.max(), np.quantile(error, 0.99)

    def growth(self, program, rounds):
        """(what, ratio) of the quartic's least times from size to size, all sizes in turn: a machine that slows down meets
        them alike. Each run follows one of the same size that is not counted: a virtual machine may hand out memory that
        it has not touched lately at 0.6 GB/s, other memory at 8.5, and a large run would pay for what a small one has."""
        triangles = {k: self.meshes[f"quartic_{k}"][2] for k in SIZES[2:] if f"quartic_{k}" in self.meshes}
        least = {k: math.inf for k, n in triangles.items() if n <= ALONE or program == "distance"}
        for _ in range(rounds):
            for k in least:
                self.one(f"quartic_{k}", program)
                seconds, _, code = self.one(f"quartic_{k}", program)
                least[k] = min(least[k], seconds) if code == 0 else math.nan
        for a, b in zip(least, list(least)[1:]):
            yield f"growth quartic {a} -> {b}", least[b] / least[a]

    def threads(self, name):
        """Seconds of the geodesics alone with two threads over those with one."""
        path, vertex, _ = self.meshes[name]
        report = f"{self.o.work}/distance.json"
        least = {1: math.inf, 2: math.inf}
        for _ in range(3):
            for n in least:
                subprocess.run([self.o.program, "distance", path, "--vertex", str(vertex), "--quiet", "--report", report,
                                "--threads", str(n)], check=True)
                with open(report) as f:
                    least[n] = min(least[n], json.load(f)["seconds"]["distance"])
        return least[2] / least[1]

    def slowest(self):
        """Most seconds of `dmkcl distance` on any of the real meshes that it takes."""
        there = f"{self.o.work}/real"
        most = math.nan
        for f in sorted(os.listdir(there) if os.path.isdir(there) else []):
            if f.endswith(".off"):
                seconds, _, code = self.run([self.o.program, "distance", f"{there}/{f}", "--vertex", "0", "--quiet"])
                most = max(seconds, most) if code == 0 and most == most else seconds if code == 0 else most
        return most

    # ---- the account ----

    def seconds(self, name, program="dmkcl"):
        for r in self.rows:
            if r["mesh"] == name and r["program"] == program:
                return float(r["seconds"])
        return math.nan

    def megabytes(self, name, program="dmkcl"):
        for r in self.rows:
            if r["mesh"] == name and r["program"] == program:
                return float(r["megabytes"])
        return math.nan

    def least(self, name, *stages):
        return min((sum(r["seconds"][s] for s in stages) for r in self.reports.get(name, [])),
                   default=math.nan)

    def bounds(self):
        """(what, measured, bound) of the figures that the project sets itself."""
        s = self.seconds
        q = {k: f"quartic_{k}" for k in SIZES}
        for k, bound in (("70k", 0.4), ("270k", 0.22), ("1.08M", 0.05)):
            yield f"quartic {k}, ratio to robust heat", s(q[k]) / s(q[k], "heat_robust"), bound
        for m in REAL:
            if m in self.meshes:
                yield f"{m}, ratio to robust heat", s(m) / s(m, "heat_robust"), 1.0
        yield from self.distance_bounds(q)
        t = "torus_symmetric_87k"
        yield "symmetric torus 87k, ratio to exact", s(t) / s(t, "exact"), 0.1
        for what, ratio in self.growth("dmkcl", 5):
            yield what, ratio, 4.4
        if self.next:
            yield "next source to the first, quartic 270k", self.next[1] / self.next[0], 0.6
        before = self.least(q["270k"], "read", "setup", "distance", "start")
        solve = self.least(q["270k"], "solve")
        yield "set-up / outer loop, quartic 270k", self.least(q["270k"], "setup") / solve, 0.5
        yield "before the first step / outer loop, quartic 270k", before / solve, 2.0
        yield "peak memory, quartic 270k, MB", self.megabytes(q["270k"]), 400

    def distance_bounds(self, q):
        """The same of `dmkcl distance`."""
        s = self.seconds
        for name in self.meshes:
            if self.meshes[name][2] <= EXACT_LIMIT:
                yield f"distance, {name}: largest error against pygeodesic", self.distance_error(name), 1e-10
        for k, bound in (("70k", 0.35), ("270k", 0.13), ("1.08M", 0.03)):
            if q[k] in self.meshes:
                yield f"distance, quartic {k}, ratio to robust heat", s(q[k], "distance") / s(q[k], "heat_robust"), bound
        for name in (q["70k"], "torus_symmetric_87k"):
            yield f"distance, {name}, ratio to exact", s(name, "distance") / s(name, "exact"), 0.06
        for what, ratio in self.growth("distance", 9):
            yield f"distance, {what}", ratio, 4.4
        yield "distance, two threads over one, quartic 270k, geodesics alone", self.threads(q["270k"]), 0.65
        for k in ("1.08M", "4.3M"):
            if q[k] in self.meshes:
                largest, most = self.merged_error(q[k])
                yield f"distance, quartic {k}, largest error", largest, 1e-5
                yield f"distance, quartic {k}, 99 % of the errors", most, 1e-6
        if any(m in self.meshes for m in REAL):
            yield "distance, slowest of libcgal-demo's meshes, seconds", self.slowest(), 3
        if q["1.08M"] in self.meshes:
            yield "distance, peak memory, quartic 1.08M, MB", self.megabytes(q["1.08M"], "distance"), 450

    def table(self):
        lines = ["| mesh | triangles | " + " | ".join([*OWN, *PEERS]) + " |",
                 "|---|--:|" + "--:|" * (len(OWN) + len(PEERS))]
        for name, (_, _, n) in self.meshes.items():
            cells = []
            for p in [*OWN, *PEERS]:
                r = next((r for r in self.rows if r["mesh"] == name and r["program"] == p), None)
                cells.append(f"{float(r['seconds']):.2f} s, {r['megabytes']} MB"
                             if r and r["runs"] else "failed" if r else "")
            lines.append(f"| {name} | {n} | " + " | ".join(cells) + " |")
        return lines

    def stages(self):
        names = ["read", "device", "setup", "distance", "start", "solve", "certify", "locus", "write", "total"]
        lines = ["| mesh | steps | V-cycles | " + " | ".join(names) + " |",
                 "|---|--:|--:|" + "--:|" * len(names)]
        for name, reports in self.reports.items():
            r = min(reports, key=lambda r: r["seconds"]["total"])
            lines.append(f"| {name} | {r['steps']} | {r['v_cycles']} | " +
                         " | ".join(f"{r['seconds'][k]:.3f}" for k in names) + " |")
        return lines

    def account(self):
        lines = []
        lines += ["| what | measured | at most | |", "|---|--:|--:|---|"]
        for what, value, bound in self.bounds():
            if not math.isnan(value):
                lines.append(f"| {what} | {value:.3g} | {bound:g} | "
                             f"{'ok' if value <= bound else 'missed'} |")
        if not self.next:
            lines.append("| next source to the first | not measured: no `--sources` | 0.6 | |")
        for r in self.rows:
            if r["program"] == "dmkcl cold":
                lines.append(f"| cold kernel caches, {r['mesh']}, s | {r['seconds']} | | |")
        return lines

    def write(self, load):
        fields = dict(device=self.device, driver=self.driver, cores=os.cpu_count(),
                      commit=self.commit, date=self.date)
        path = f"{self.o.results}/bench.csv"
        with open(path, "w", newline="") as f:
            w = csv.DictWriter(f, [*self.rows[0], *fields])
            w.writeheader()
            w.writerows({**r, **fields} for r in self.rows)
        text = "\n".join([
            "# Whole runs beside peers", "",
            f"`make bench` ({self.o.form}), {self.date}, commit {self.commit}, {os.cpu_count()} cores, "
            f"{self.device} (driver {self.driver}). Load of the machine at the start and the end: "
            f"{load[0]:.1f}, {load[1]:.1f} (1 minute). Seconds from start to end of the process and peak "
            "memory, least of the rounds. heat_robust, heat_plain, fast_marching: potpourri3d; exact: "
            "pygeodesic. The peers and `distance` (`dmkcl distance`) give a distance; dmkcl also density, bounds and the cut "
            "locus.", "",
            *self.table(), "", "## Bounds", "", *self.account(), "",
            "## Stages of dmkcl's fastest run, seconds", "",
            "`device` runs beside `read`.", "", *self.stages(), ""])
        with open(f"{self.o.results}/bench.md", "w") as f:
            f.write(text)
        print("\n" + text)


def main():
    a = argparse.ArgumentParser(description=__doc__,
                                formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("form", nargs="?", default="usual", choices=["quick", "usual", "full"])
    a.add_argument("--program", default="build/release/dmkcl")
    a.add_argument("--work", default="build/bench")
    a.add_argument("--results", default="bench/results")
    o = a.parse_args()
    quick = o.form == "quick"
    b = Bench(o)
    load = [os.getloadavg()[0]]
    for surface in ["quartic"] if quick else SURFACES:
        for k in range(4 if quick else 5):
            b.surface(surface, k)
    if o.form == "full":
        b.surface("quartic", 5)
    b.symmetric_torus()
    if not quick:
        b.real_meshes()
    b.cold("quartic_70k" if quick else "quartic_270k")
    for name, (_, _, n) in b.meshes.items():
        peers = [p for p in PEERS if p != "exact" or n <= EXACT_LIMIT]
        large, huge = n > 200_000, n > 800_000
        if huge and o.form != "full":
            peers = ["fast_marching"] + ["heat_robust"] * (name == "quartic_1.08M")
        b.measure(name, peers, 3 if huge or quick else 5, 1 if huge else 2 if large or quick else 3)
    largest = "quartic_270k"
    b.next = b.next_sources(largest)
    load.append(os.getloadavg()[0])
    b.write(load)


if __name__ == "__main__":
    main()
