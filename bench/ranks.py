#!/usr/bin/env python3
"""What a solve on several ranks sends: a model, checked against counts, for up to 1,024 ranks.

usage: ranks.py [--program build/mpi/dmkcl] [--triangles N] [--out FILE.md]
A quartic of N triangles (default 269,000) is solved by 2, 4 and 8 ranks under mpirun. The reports count
exchanges, messages, bytes and sums of each rank; the model's two free numbers, the ghosts' depth on T/2 and on
the graph levels, are fitted to the run of 4 ranks and tried on the others. All counts are of the worst rank.

The model. A rank owns n = 2 N / R rows of T/2 (four per vertex); its border is as long as that of
1 / R of a sphere, and so are its ghosts: G = a sqrt(n (1 - 1 / R)). Of a level with v vertices it has 1 / R, and
H = b sqrt(v / R (1 - 1 / R)) ghosts.
    V-cycle     5 exchanges of rows, one of them with the first level's vertices, 2 of each dealt level and 1 for each
                of its smoothing steps, and 1 that gathers two vectors of the first whole one
    CG step     1 V-cycle, 1 exchange of rows, 1 sum
    Newton step 1 exchange of rows in double precision, 1 in single, 1 of edges per level, 3 sums
Levels thin out by 6; those of fewer than 10,000 vertices are whole.
"""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile

FITTED = 4
PART = 512  # items of a launch's part
SUM_SHORT, SUM_BLOCK = 8192, 32  # of more parts than that, blocks are summed first (kernels/dmk_shared.h)
THINNING, GATHER_BELOW = 6, 10000
FINE, LEVEL, GATHERED = 5, 2, 2  # vectors that a V-cycle exchanges, and gathers
STEPS_ON_T, STEPS_ON_LEVEL = 3, 2  # of smoothing (src/solver/multigrid.c)
# A large GPU in each rank and a fast network: seconds a message, bytes a second of network and memory,
# bytes that a V-cycle moves per triangle (study of the kernels: 5.5 applications of 42 B and transfers).
LATENCY, NETWORK, MEMORY, TRAFFIC, LAUNCH = 3e-6, 2e10, 3e12, 330, 5e-6


def levels(triangles):
    """Vertices of the dealt levels, and of the first whole one."""
    dealt = [triangles / 2]
    while dealt[-1] / THINNING >= GATHER_BELOW:
        dealt.append(dealt[-1] / THINNING)
    return dealt, dealt[-1] / THINNING


def border(n, ranks):
    """Length of the border of a rank's share of n: of 1 / R of a sphere, up to a factor."""
    return math.sqrt(n / ranks * (1 - 1 / ranks))


def vectors(level):
    """Exchanged in a V-cycle on dealt level 0, 1, ..."""
    return LEVEL + (STEPS_ON_LEVEL if level else STEPS_ON_T)


def ghosts(triangles, ranks, a):
    return a * border(2 * triangles, ranks)


def cycle(triangles, ranks, a, b):
    """Exchanges, messages and bytes that a rank sends in one CG step with its V-cycle, and bytes to a sum."""
    dealt, whole = levels(triangles)
    if ranks == 1:
        return 0, 0, 0, 0
    exchanges = FINE + 1 + sum(vectors(i) for i in range(len(dealt))) - 1 + 1
    neighbours = min(ranks - 1, 6)  # chunks along a curve that fills the plane
    messages = neighbours * (exchanges - 1) + ranks - 1
    sent = 4 * (FINE + 1) * ghosts(triangles, ranks, a)
    sent += sum(4 * vectors(i) * b * border(v, ranks) for i, v in enumerate(dealt))
    sent += 4 * GATHERED * whole / ranks * (ranks - 1)
    return exchanges, messages, sent, 8 * 3 * given(triangles, ranks)


def given(triangles, ranks):
    """Numbers that a rank tells the others for one quantity's sum over the rows: a run of edges and one of vertices."""
    parts = 2 * triangles / PART
    if parts <= SUM_SHORT:
        return parts / ranks
    return parts / ranks / SUM_BLOCK + 2 * (SUM_BLOCK - 1)


def seconds(triangles, ranks, a, b):
    """Of one CG step: work, messages one after the other (each exchange waits for the slowest), sums."""
    dealt, whole = levels(triangles)
    work = TRAFFIC * triangles / ranks / MEMORY + (60 + 10 * len(dealt)) * LAUNCH
    exchanges, _, sent, given = cycle(triangles, ranks, a, b)
    if ranks == 1:
        return work, 0
    steps = math.ceil(math.log2(ranks))
    talk = exchanges * (LATENCY + 4 * LAUNCH) + sent / NETWORK
    talk += steps * LATENCY + given * ranks / NETWORK
    return work, talk


def run(program, mesh, ranks, report):
    environment = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    subprocess.run(["mpirun", "--oversubscribe", "-n", str(ranks), program, "solve", mesh, "--vertex", "0",
                    "--quiet", "--report", report], check=True, env=environment)
    with open(report, encoding="utf-8") as file:
        return json.load(file)


def worst(report, key):
    return max(rank[key] for rank in report["ranks"])


def fit(report, triangles):
    """a and b from the ghosts of the rows, and from the bytes that the rows leave; of the run of FITTED ranks."""
    a = worst(report, "ghost_rows") / border(2 * triangles, FITTED)
    low, high = 0.0, 1000.0
    for _ in range(60):
        b = (low + high) / 2
        if total(report, triangles, FITTED, a, b)[1] > worst(report, "bytes"):
            high = b
        else:
            low = b
    return a, b


def total(report, triangles, ranks, a, b):
    """Exchanges, bytes and sums of a whole solve."""
    dealt, _ = levels(triangles)
    exchanges, _, sent, _ = cycle(triangles, ranks, a, b)
    steps, cycles = report["steps"] + 2, report["v_cycles"]  # two of the certificate
    refresh = len(dealt) + 1
    rows = 4 * ghosts(triangles, ranks, a)
    edges = sum(4 * 3 * b * border(v, ranks) for v in dealt)
    return (cycles * exchanges + steps * (refresh + 2), cycles * sent + steps * (3 * rows + edges),
            cycles + 3 * steps)


def check(program, triangles, lines):
    with tempfile.TemporaryDirectory() as folder:
        mesh = os.path.join(folder, "quartic.ply")
        subprocess.run([program, "mesh", "quartic", "--triangles", str(triangles), "--quiet", "--out", mesh],
                       check=True)
        reports = {r: run(program, mesh, r, os.path.join(folder, f"{r}.json")) for r in (2, 4, 8)}
    triangles = reports[2]["mesh"]["n_triangles"]
    a, b = fit(reports[FITTED], triangles)
    lines += [f"Quartic, {triangles:,} triangles; a = {a:.2f}, b = {b:.2f} from the run of {FITTED} ranks. Measured / model,",
              "of the worst rank:", "",
              "| ranks | CG steps | ghost rows | of own | exchanges | with work meanwhile | MB sent | sums | memory, MB |",
              "|--:|--:|--:|--:|--:|--:|--:|--:|--:|"]
    good = True
    for ranks, r in reports.items():
        exchanges, sent, sums = total(r, triangles, ranks, a, b)
        pairs = [(worst(r, "ghost_rows"), ghosts(triangles, ranks, a)), (worst(r, "exchanges"), exchanges),
                 (worst(r, "bytes") / 1e6, sent / 1e6), (worst(r, "sums"), sums)]
        good = good and all(1 / 1.6 < measured / modelled < 1.6 for measured, modelled in pairs)
        share = 100 * worst(r, "ghost_rows") / (2 * triangles / ranks)
        text = [f"{measured:,.0f} / {modelled:,.0f}" if measured > 100 else f"{measured:.2g} / {modelled:.2g}"
                for measured, modelled in pairs]
        lines.append(f"| {ranks} | {r['cg_iterations']} | {text[0]} | {share:.1f} % | {text[1]} | "
                     f"{worst(r, 'overlapped')} | {text[2]} | {text[3]} | "
                     f"{worst(r, 'peak_memory') / 1e6:.0f} |")
    return a, b, good


def extrapolate(a, b, lines):
    lines += ["", "One CG step with its V-cycle, by the model, on ranks with a GPU of "
              f"{MEMORY / 1e12:.0f} TB/s each, {LATENCY * 1e6:.0f} us a message and {NETWORK / 1e9:.0f} GB/s, "
              "no message hidden behind work:", "",
              "| triangles | ranks | ghosts of own rows | messages | kB sent | work, ms | messages, ms | efficiency |",
              "|--:|--:|--:|--:|--:|--:|--:|--:|"]
    for triangles in (1e7, 1e8, 1e9):
        alone = seconds(triangles, 1, a, b)[0]
        for ranks in (1, 4, 16, 64, 256, 1024):
            work, talk = seconds(triangles, ranks, a, b)
            _, messages, sent, _ = cycle(triangles, ranks, a, b)
            share = 0 if ranks == 1 else 100 * ghosts(triangles, ranks, a) / (2 * triangles / ranks)
            lines.append(f"| {triangles:.0e} | {ranks:,} | {share:.2f} % | {messages:,.0f} | {sent / 1e3:,.0f} | "
                         f"{work * 1e3:.2f} | {talk * 1e3:.2f} | {100 * alone / ranks / (work + talk):.0f} % |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--program", default="build/mpi/dmkcl")
    parser.add_argument("--triangles", type=int, default=269000)
    parser.add_argument("--out", default="bench/results/ranks.md")
    options = parser.parse_args()
    lines = ["# What several ranks send", "", "`make bench-ranks`; the model stands at the head of `bench/ranks.py`.", ""]
    a, b, good = check(options.program, options.triangles, lines)
    extrapolate(a, b, lines)
    least, most = (24 * given(1e9, ranks) * ranks / 1e6 for ranks in (1, 1024))
    lines += ["", "Messages of 3 us eat what more than some ten ranks gain on 10^7 triangles. The sums of a CG step are "
              f"{least:.1f} to {most:.1f} MB", "at 10^9 triangles, of 1 to 1,024 ranks: sums of blocks. Without those they were 94.",
              "No run had more than 8 ranks: what is above 8 is the model's alone. Above 134,217,727 triangles the result's",
              "arrays stand in the way, whose numbers have 32 bits (see src/ranks/RANKS.md).", ""]
    with open(options.out, "w", encoding="utf-8") as file:
        file.write("\n".join(lines))
    print("\n".join(lines))
    if not good:
        sys.exit("ranks.py: a count is more than 1.6 times off the model")


if __name__ == "__main__":
    main()
