#!/usr/bin/env python3
"""Small wrong changes of the sources, one at a time, and whether a test notices.

usage: mutate.py [--count N] [--seed S] [--rooms ROOM,...] [--files PATTERN] [--all-tests] [--list] [--floor SHARE]
       mutate.py --only 'FILE:LINE:OPERATOR'

A copy of the repository in build/mutate is changed, built and tested; the working tree stays as it is. Each mutant
is one operator at one place of a C file or kernel; one that compiles to the same object is none. The tests of its
room run first, the fastest first, until one fails; a mutant that none notices is a survivor. Survivors that cannot
be noticed stand in known.txt with the reason. The sample is drawn by the seed, the same share of each room. Prints
the survivors, a table by room, and at last "# tried N: failed M", M counting survivors without a reason beyond what
--floor (0.95) allows."""
import argparse
import fnmatch
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
TREE = os.path.join(ROOT, "build", "mutate")
BUILD = "build/release"

# Tests by room: these first; then, with --all-tests, all others. Rooms without a line: GENERAL.
GENERAL = ["api", "mesh", "solver", "operator", "exact", "same", "cancel", "hostile"]
ROOM_TESTS = {
    "base": ["base", "outfile", "parallel", "number", "mesh", "arguments", "cancel", "coarsen", "solver", "geodesic"],
    "mesh": ["base", "mesh", "repair", "units", "operator", "coarsen", "solver", "geodesic", "surface", "hostile",
             "meshes.sh", "cli.sh"],
    "surfaces": ["surface", "mesh", "geometry.sh"],
    "levels": ["coarsen", "units", "solver", "operator"],
    "io": ["number", "io", "foreign", "ply_stl", "repair", "meshes.sh", "outputs.sh"],
    "geodesic": ["geodesic", "units", "start", "slender", "hostile", "once.sh"],
    "device": ["device", "cache", "operator", "solver", "arguments", "environment.sh"],
    "solver": ["operator", "units", "solver", "transport", "start", "certificate", "acl", "exact", "coarsen", "same", "cancel",
               "once.sh", "transport.sh"],
    "locus": ["locus", "units", "cancel", "hostile", "geometry.sh", "once.sh"],
    "api": ["arguments", "api", "solver", "cancel", "locus", "geodesic", "acl", "io", "hostile", "cli.sh", "once.sh",
            "reports.sh", "outputs.sh"],
    "cli": ["json", "cli.sh", "outputs.sh", "reports.sh", "batch.sh", "meshes.sh", "messages.sh", "environment.sh"],
    "ranks": ["ranks"],
    "kernels": ["operator", "units", "solver", "transport", "certificate", "acl", "exact", "same", "layers.sh"],
}

# ---- operators: what is found in a line, and what takes its place ---------------------------

NUMBER = r"(?<![\w.])(\d+\.\d*(?:[eE][-+]?\d+)?|\d+[eE][-+]?\d+|\.\d+|\d+)(f?)(?![\w.])"


def scaled(factor):
    def change(match):
        text, suffix = match.groups()
        if re.fullmatch(r"\d+", text):
            value = int(text) * 2 if factor == 2 else int(text) // 2
            if int(text) <= 1:
                value = 1 - int(text) if factor == 2 else None
            return None if value is None or value == int(text) else f"{value}{suffix}"
        return f"{float(text) * factor!r}{suffix}" if float(text) != 0 else None
    return change


def exchange(pairs):
    return lambda match: pairs[match.group(0)]


OPERATORS = [
    ("comparison", r"(?<=[\w)\]] )(<=|>=|==|!=|<|>)(?= [-\w(*&!~])",
     exchange({"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="})),
    ("turned", r"(?<=[\w)\]] )(<=|>=|<|>)(?= [-\w(*&!~])", exchange({"<": ">", "<=": ">=", ">": "<", ">=": "<="})),
    ("sign", r"(?<=[\w)\]] )[-+](?= [\w(*&])", exchange({"+": "-", "-": "+"})),
    ("factor", r"(?<=[\w)\]] )[*/](?= [\w(*&])", exchange({"*": "/", "/": "*"})),
    ("sum", r"(?<=[\w\])] )[-+]=(?= )", exchange({"+=": "-=", "-=": "+="})),
    ("logic", r"(&&|\|\|)", exchange({"&&": "||", "||": "&&"})),
    ("double", NUMBER, scaled(2)),
    ("half", NUMBER, scaled(0.5)),
    ("off by one", r"(?<=; )(\w+) < ([\w>.-]+)(?=; )", lambda m: f"{m.group(1)} < {m.group(2)} - 1"),
    ("term", r"(?<=[\w)\]]) [-+] [\w.>\[\]-]+ \* [\w.>\[\]-]+(?=[;)])", lambda m: ""),
    ("negated", r"\bif \((.*)\)(?=( \{| return| goto| break| continue|$))", lambda m: f"if (!({m.group(1)}))"),
    ("statement", r"^( +)((?!return|goto|break|continue|case|const|static|DMK_TRY\(DMK_NEW|va_|int |size_t |double |float |bool "
                  r"|char |real |struct |dmk_\w+ \*?\w+( =|;|\[))[\w*(].*;)$", lambda m: f"{m.group(1)};"),
    ("extreme", r"\b(fmin|fmax|dmk_min_i|dmk_max_i)(?=\()",
     exchange({"fmin": "fmax", "fmax": "fmin", "dmk_min_i": "dmk_max_i", "dmk_max_i": "dmk_min_i"})),
    ("arguments", r"(?<=\()([\w.>-]+), ([\w.>-]+)(?=\);)", lambda m: f"{m.group(2)}, {m.group(1)}"),
    ("index", r"(?<=\[)(\w+)(?=\])", lambda m: None if m.group(1).isdigit() else f"{m.group(1)} ^ 1"),
    ("answer", r"\breturn (true|false);", lambda m: f"return {'false' if m.group(1) == 'true' else 'true'};"),
]


def code_lines(path):
    """(number, text) of the lines that hold code and only code, without comments and literals that mean words."""
    in_comment = False
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            text = line.rstrip("\n")
            if in_comment:
                in_comment = "*/" not in text
                continue
            stripped = text.strip()
            if stripped.startswith("/*") or stripped.startswith("*"):
                in_comment = "*/" not in text
                continue
            if stripped.startswith("#") or not stripped or '"' in text or re.search(r"DMK_NEW|alloc\(|sizeof", text):
                continue
            code = re.sub(r"/\*.*?\*/", lambda m: " " * len(m.group(0)), text)
            if "/*" in code:
                in_comment, code = True, code[:code.index("/*")]
            if code.strip() and not re.match(r"^\S.*\)$|^(static|extern|typedef|enum|struct)\b", code):
                yield number, code.rstrip()


DECLARATION = re.compile(r"^ +(?!return|goto|case|else)(?:(?:const|static|volatile|unsigned|struct) )*[A-Za-z_]\w* "
                         r"\**[A-Za-z_]\w*[\[,;= ]")


def is_size(line, place):
    """Whether the place lies in the brackets of an array that the line declares: more room changes nothing, and less
    is for the sanitizers to see."""
    if not DECLARATION.match(line):
        return False
    for b in re.finditer(r"\w\[([^\]]*)\]", line):
        before = line[:b.start()]
        outside = all(before.count(x) == before.count(y) for x, y in ("()", "[]", "{}"))
        if b.start(1) <= place < b.end(1) and outside and "=" not in before.rsplit(", ", 1)[-1]:
            return True
    return False


def mutants_of(path):
    for number, line in code_lines(os.path.join(ROOT, path)):
        for name, pattern, change in OPERATORS:
            for at, match in enumerate(re.finditer(pattern, line)):
                new = change(match)
                if new is not None and new != match.group(0) and not is_size(line, match.start()):
                    yield (path, number, f"{name}#{at}", line, line[:match.start()] + new + line[match.end():])


def room_of(path):
    return "kernels" if path.startswith("kernels/") else path.split("/")[1]


def all_files(patterns):
    known = subprocess.run(["git", "ls-files", "src", "kernels"], cwd=ROOT, capture_output=True, text=True, check=True)
    for path in known.stdout.split():
        if path.startswith("src/python") or not path.endswith((".c", ".cl")) or path.count("/") < 1:
            continue
        if not os.path.exists(os.path.join(ROOT, path)):
            continue
        if not patterns or any(fnmatch.fnmatch(path, p) for p in patterns.split(",")):
            yield path


# ---- the copy, its build and its tests ------------------------------------------------------


def copy_tree():
    os.makedirs(TREE, exist_ok=True)
    names = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\n")
    for name in filter(None, names):
        source, target = os.path.join(ROOT, name), os.path.join(TREE, name)
        if not os.path.exists(source):
            if os.path.exists(target):
                os.remove(target)
            continue
        os.makedirs(os.path.dirname(target), exist_ok=True)
        if not os.path.exists(target) or open(source, "rb").read() != open(target, "rb").read():
            shutil.copy(source, target)
    for folder in ("src", "kernels", "tests"): # what is gone in the tree is gone in the copy
        for base, _, files in os.walk(os.path.join(TREE, folder)):
            for name in files:
                relative = os.path.relpath(os.path.join(base, name), TREE)
                if not os.path.exists(os.path.join(ROOT, relative)):
                    os.remove(os.path.join(base, name))


def run(command, seconds, environment=None):
    """(exit status, output); 124 when it took too long."""
    process = subprocess.Popen(command, cwd=TREE, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, start_new_session=True)
    try:
        text = process.communicate(timeout=seconds)[0]
        return process.returncode, text.decode(errors="replace")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return 124, ""


class Tests:
    """Tests by name, "solver" or "cli.sh", with their seconds on the sources as they are."""

    def __init__(self, wanted):
        self.environment, self.seconds = dict(os.environ, KEEP_SCRATCH="1", INTERRUPTS="0"), {}
        self.targets = sorted(f"{BUILD}/tests/test_{n}" for n in wanted if not n.endswith(".sh"))
        self.targets += [f"{BUILD}/dmkcl"] if any(n.endswith(".sh") for n in wanted) else []
        self.targets += [f"{BUILD}/faults/dmkcl", f"{BUILD}/faults/library"] if "faults.sh" in wanted else []
        status, text = self.build()
        if status != 0:
            sys.exit(text[-4000:] + "the sources do not build as they are")
        for name in wanted:
            begin = time.monotonic()
            if self.passes(name, 900):
                self.seconds[name] = time.monotonic() - begin
            else:
                print(f"test_{name} fails on the sources as they are: left out", flush=True)

    def build(self):
        return run(["make", "-s", f"-j{os.cpu_count()}", "CONFIG=release", "OPT_release=-O1 -march=native -fno-math-errno",
                    *self.targets], 600)

    def passes(self, name, limit):
        test = f"tests/test_{name}" if name.endswith(".sh") else f"{BUILD}/tests/test_{name}"
        return run(["sh", "tests/run.sh", BUILD, test], limit, self.environment)[0] == 0

    def kill(self, names):
        """The test that fails, or None."""
        for name in names:
            if name in self.seconds and not self.passes(name, 20 + 5 * self.seconds[name]):
                return name
        return None


def load_known():
    """{(file, operator, line without blanks): reason}"""
    known, path = {}, os.path.join(HERE, "known.txt")
    if os.path.exists(path):
        for line in open(path, encoding="utf-8"):
            if line.strip() and not line.startswith("#"):
                file, operator, text, reason = (part.strip() for part in line.rstrip("\n").split(" | ", 3))
                known[file, operator, re.sub(r"\s", "", text)] = reason
    return known


def draw(arguments):
    rooms = {}
    for path in all_files(arguments.files):
        rooms.setdefault(room_of(path), []).extend(mutants_of(path))
    if arguments.rooms:
        rooms = {room: m for room, m in rooms.items() if room in arguments.rooms.split(",")}
    if arguments.only:
        file, number, operator = arguments.only.split(":")
        return [m for m in mutants_of(file) if m[1] == int(number) and m[2].startswith(operator)]
    chance, drawn = random.Random(arguments.seed), []
    total = sum(len(m) for m in rooms.values())
    for room in sorted(rooms):
        count = round(arguments.count / 2 / len(rooms) + arguments.count / 2 * len(rooms[room]) / total)
        drawn += chance.sample(rooms[room], min(count, len(rooms[room])))
    return drawn


def object_of(path):
    """What the C file compiles to, or None: kernels are compiled by their device."""
    try:
        with open(os.path.join(TREE, BUILD, path[:-1] + "o"), "rb") as file:
            return file.read() if path.endswith(".c") else None
    except FileNotFoundError:
        return None


def try_mutant(mutant, tests, order, original):
    """"no mutant" if it does not build or compiles to the same, the test that fails, or None."""
    path, number, _, old, new = mutant
    target = os.path.join(TREE, path)
    with open(target, encoding="utf-8") as file:
        lines = file.read().split("\n")
    whole = list(lines)
    lines[number - 1] = lines[number - 1].replace(old.strip(), new.strip() or ";", 1)
    try:
        with open(target, "w", encoding="utf-8") as file:
            file.write("\n".join(lines))
        status, _ = tests.build()
        same = original is not None and original == object_of(path)
        return "no mutant" if status != 0 or same else tests.kill(order)
    finally:
        with open(target, "w", encoding="utf-8") as file:
            file.write("\n".join(whole))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rooms", default="")
    parser.add_argument("--files", default="")
    parser.add_argument("--only", default="")
    parser.add_argument("--all-tests", action="store_true")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--floor", type=float, default=0.95)
    arguments = parser.parse_args()
    drawn, known = draw(arguments), load_known()
    if arguments.list:
        for path, number, operator, _, new in drawn:
            print(f"{path}:{number}: {operator}: {new.strip()}")
        return 0
    available = {f[5:-2] if f.endswith(".c") else f[5:] for f in os.listdir(os.path.join(ROOT, "tests"))
                 if f.startswith("test_") and f.endswith((".c", ".sh"))}
    wanted = set()
    for room in {room_of(m[0]) for m in drawn}:
        wanted |= set(ROOM_TESTS.get(room, GENERAL))
    copy_tree()
    tests = Tests(sorted((available if arguments.all_tests else wanted) & available))
    objects = {path: object_of(path) for path in {m[0] for m in drawn}}
    table, survivors = {}, []
    for mutant in drawn:
        path, number, operator, old, new = mutant
        room = room_of(path)
        order = [n for n in ROOM_TESTS.get(room, GENERAL) if n in tests.seconds]
        order += sorted(set(tests.seconds) - set(order), key=tests.seconds.get) if arguments.all_tests else []
        row = table.setdefault(room, {"tried": 0, "died": 0, "known": 0, "survived": 0, "no mutant": 0})
        reason = known.get((path, operator.split("#")[0], re.sub(r"\s", "", old)))
        end = "known" if reason else try_mutant(mutant, tests, order, objects[path])
        if end == "no mutant":
            row["no mutant"] += 1
            continue
        row["tried"] += 1
        row["known" if end == "known" else "died" if end else "survived"] += 1
        if not end:
            survivors.append(mutant)
        print(f"{'died' if end else 'SURVIVED'} {path}:{number}: {operator}: {old.strip()} -> {new.strip() or ';'}"
              f"{'  [' + end + ']' if end else ''}", flush=True)
    print(f"\n{'room':12} {'tried':>6} {'died':>6} {'known':>6} {'survived':>9} {'share':>7}")
    total = {"tried": 0, "died": 0, "known": 0, "survived": 0}
    for room, row in sorted(table.items()):
        for key in total:
            total[key] += row[key]
    for room, row in [*sorted(table.items()), ("all", total)]:
        share = row["died"] / max(1, row["tried"] - row["known"])
        print(f"{room:12} {row['tried']:6} {row['died']:6} {row['known']:6} {row['survived']:9} {100 * share:6.1f}%")
    meant = total["tried"] - total["known"]
    failed = 0 if total["died"] >= arguments.floor * meant else total["survived"]
    print(f"# tried {total['tried']}: failed {failed}")
    return failed > 0


if __name__ == "__main__":
    sys.exit(main())
