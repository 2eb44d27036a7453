#!/usr/bin/env python3
"""Small wrong changes of the sources, one at a time, and whether a test notices.

usage: mutate.py [--count N] [--seed S] [--rooms ROOM,...] [--files PATTERN,...] [--tests PATTERN,...]
                 [--constants] [--budget SECONDS] [--seconds SECONDS] [--floor SHARE]
                 [--list | --table [--page FILE.md] | --direct]
       mutate.py --only 'FILE:LINE:OPERATOR'

A copy of the repository in build/mutate is changed, built and tested; the working tree stays as it is. Each mutant
is one operator at one place of a C file, header or kernel; one that compiles to the same objects is none. --constants:
those of constants alone, all of them, doubled and halved. First each test is run once with line counters: what it
reaches and how long it takes. A mutant is then tried by the tests that reach its line, or one that names its constant,
those that noticed others of its file first, then the fastest, up to --budget seconds (60; 0: all of them); one that
none notices is a survivor. Survivors that cannot be noticed stand in known.txt with the reason. --direct: no
lines are counted; each mutant meets all test programs that --tests names, as a whole.

The sample is the same as long as its lines are: mutants are ranked by a hash of the seed and what they are, and each
room gives the first of them. What a mutant came to is kept in build/mutate-*.json and holds until its file changes; a
survivor is tried again, at the end, by tests that are new or that it has not met. So a run can end (--seconds) and go
on later; remove build/mutate-mutants.json to begin anew. Prints the survivors, a table by room, and at last
"# tried N: failed M", M counting survivors without a reason beyond what --floor (0.95) allows."""
import argparse
import collections
import fnmatch
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
TREE = os.path.join(ROOT, "build", "mutate")
KEPT = os.path.join(ROOT, "build", "mutate-%s.json") # tests, mutants
BUILD, COUNTED = "build/release", "build/coverage"
MAKE = ["make", "-s", f"-j{os.cpu_count()}",
        "OPT_release=-O1 -march=native -fno-math-errno -Wno-unused -Wno-unused-parameter",
        "OPT_coverage=-O1 -g --coverage -fprofile-update=atomic"]
# Seconds beyond five times its own until a test hangs; of a changed kernel, which is compiled in 5, on a busy machine
# in 40.
PATIENCE, PATIENCE_KERNEL = 20, 60
# Tests of the text of the sources, of packages and of what other programs make of files.
NOT_TESTS = ["layers.sh", "wheel.sh", "install.sh", "runner.sh", "formats.sh", "paper.sh", "python.sh", "mpi.sh",
             "random.sh", "memory.sh"]

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
                  r"|char |real |struct |free\(|dmk_\w+ \*?\w+( =|;|\[))[\w*(].*;)$", lambda m: f"{m.group(1)};"),
    ("extreme", r"\b(fmin|fmax|dmk_min_i|dmk_max_i)(?=\()",
     exchange({"fmin": "fmax", "fmax": "fmin", "dmk_min_i": "dmk_max_i", "dmk_max_i": "dmk_min_i"})),
    ("arguments", r"(?<=\()([\w.>-]+), ([\w.>-]+)(?=\);)", lambda m: f"{m.group(2)}, {m.group(1)}"),
    ("index", r"(?<=\[)(\w+)(?=\])", lambda m: None if m.group(1).isdigit() else f"{m.group(1)} ^ 1"),
    ("answer", r"\breturn (true|false);", lambda m: f"return {'false' if m.group(1) == 'true' else 'true'};"),
]

# Of a constant: what a shift shifts, not by how much; no marks like -1.
VALUE = r"(?<!<< )(?<!= -(?=\d[^.]))" + NUMBER
CONSTANT_OPERATORS = [("double", VALUE, lambda m: f"2{m.group(2)}" if m.group(1) == "1" else scaled(2)(m)),
                      ("half", VALUE, scaled(0.5))]

# Constants of a whole file, which stand outside functions; and those of a function.
CONSTANT = re.compile(r"^(static const \w+ \w+ = [^{]+;|enum \{.* = .*\};|#define [A-Z_]+ [\d(])")
LOCAL = re.compile(r"^ +((static )?const \w+ \w+ = [-\d.e *<]+[;,]|enum \{.* = .*\};|[A-Z_]+ = \d+( << \d+)?,?$)")


def code_lines(path):
    """(number, text) of the lines that hold code and only code, without comments and literals that mean words; of a
    header, constants, their tables, and functions."""
    in_comment, inside = False, not path.endswith(".h")
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
            constant = CONSTANT.match(text)
            if path.endswith(".h"):
                begins = re.match(r"\{$|(enum|static const .* =) \{$", text)
                inside = not text.startswith("}") and (inside or begins is not None)
            if not stripped or '"' in text or re.search(r"DMK_NEW|alloc\(|sizeof", text):
                continue
            if stripped.startswith("#") and not constant:
                continue
            code = re.sub(r"/\*.*?\*/", lambda m: " " * len(m.group(0)), text)
            if "/*" in code:
                in_comment, code = True, code[:code.index("/*")]
            head = re.match(r"^\S.*\)$|^(static|extern|typedef|enum|struct)\b", code)
            if constant or inside and code.strip() and not head:
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


Mutant = collections.namedtuple("Mutant", "path line operator old new key")


COLUMNS = ["tried", "died", "known", "survived"]

# `if (a > b) a = b;` is the same with >=.
CLAMP = re.compile(r"if \((\S+) [<>]=? (\S+)\) (?:\1 = \2|\2 = \1);")


def names_of(line):
    """The constants that the line defines."""
    if not CONSTANT.match(line) and not LOCAL.match(line):
        return []
    return re.findall(r"#define (\w+)", line) or re.findall(r"(\w+) = ", line)


def mutants_of(path, constants):
    seen = collections.Counter()
    for number, line in code_lines(os.path.join(ROOT, path)):
        seen[line] += 1
        field = path.endswith(".h") and re.match(r" +\.\w+ = [\d.]+,$", line) # of a constant table
        if constants and not names_of(line) and not field:
            continue
        for name, pattern, change in CONSTANT_OPERATORS if constants else OPERATORS:
            for at, match in enumerate(re.finditer(pattern, line)):
                new = change(match)
                idle = is_size(line, match.start()) or name == "comparison" and CLAMP.search(line)
                if new is not None and new != match.group(0) and not idle:
                    key = f"{path} | {name}#{at} | {line.strip()} | {seen[line]}"
                    new = line[:match.start()] + new + line[match.end():]
                    yield Mutant(path, number, f"{name}#{at}", line, new, key)


def room_of(path):
    return "kernels" if path.startswith("kernels/") else path.split("/")[1]


def matches(name, patterns):
    return not patterns or any(fnmatch.fnmatch(name, p) for p in patterns.split(","))


def draw(arguments):
    """Half of the sample in equal parts from the rooms, half by their sizes."""
    if arguments.only:
        path, number, operator = arguments.only.split(":")
        return [m for m in mutants_of(path, False) if m.line == int(number) and m.operator.startswith(operator)]
    rooms = collections.defaultdict(list)
    for path in subprocess.check_output(["git", "ls-files", "src", "kernels"], cwd=ROOT, text=True).split():
        if path.endswith((".c", ".h", ".cl")) and not path.startswith("src/python") and matches(path, arguments.files):
            if os.path.exists(os.path.join(ROOT, path)) and matches(room_of(path), arguments.rooms):
                rooms[room_of(path)] += mutants_of(path, arguments.constants)
    if arguments.constants:
        return sum(rooms.values(), [])
    total, drawn = sum(map(len, rooms.values())), []
    for room in sorted(rooms):
        count = round(arguments.count / 2 / len(rooms) + arguments.count / 2 * len(rooms[room]) / total)
        ranked = sorted(rooms[room], key=lambda m: hashlib.sha1(f"{arguments.seed} {m.key}".encode()).digest())
        drawn += sorted(ranked[:count], key=lambda m: (m.path, m.line))
    return drawn


# ---- the copy, its builds and its tests -----------------------------------------------------


def copy_tree():
    """The files that git knows or would take, where they differ; what is gone here is gone there."""
    names = subprocess.check_output(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, text=True).split("\n")
    names = {n for n in names if n and os.path.isfile(os.path.join(ROOT, n))}
    for name in names:
        source, target = os.path.join(ROOT, name), os.path.join(TREE, name)
        os.makedirs(os.path.dirname(target), exist_ok=True)
        if not os.path.exists(target) or content(source) != content(target):
            shutil.copy(source, target)
    for folder in ("src", "kernels", "tests", "include"):
        for base, _, files in os.walk(os.path.join(TREE, folder)):
            for path in (os.path.join(base, name) for name in files):
                if os.path.relpath(path, TREE) not in names:
                    os.remove(path)


def kill_session(leader):
    """All its processes: `timeout` gives those below it a group of their own."""
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            if os.getsid(int(name)) == leader:
                os.kill(int(name), signal.SIGKILL)
        except OSError:
            pass # it has ended


def run(command, seconds, **environment):
    """(exit status, output) in the copy; 124 when it took too long."""
    process = subprocess.Popen(command, cwd=TREE, env={**os.environ, **environment}, stdin=subprocess.DEVNULL,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True)
    try:
        text = process.communicate(timeout=seconds)[0]
        return process.returncode, text.decode(errors="replace")
    except subprocess.TimeoutExpired:
        return 124, ""
    finally: # whatever ends it takes its children with it
        if process.returncode is None:
            kill_session(process.pid)
            process.communicate()


def build(folder, test=None, *objects):
    """Whether it builds: what the test "units:name", the program "units", the script "cli.sh" needs, or everything."""
    targets = [f"{folder}/dmkcl", f"{folder}/faults/dmkcl", f"{folder}/faults/library"]
    if not test or not test.endswith(".sh"):
        targets = [f"{folder}/tests/test_{test.split(':')[0]}"] if test else ["all", *targets]
    status, text = run([*MAKE, f"CONFIG={os.path.basename(folder)}", *objects, *targets], 600)
    return status == 0 or test is None and sys.exit(text[-4000:] + "the sources do not build as they are")


def passes(folder, test, limit):
    """What counters have to say of processes that are killed, or have no room for a file, goes beside the test."""
    name, _, function = test.partition(":")
    path = f"tests/test_{name}" if name.endswith(".sh") else f"{folder}/tests/test_{name}"
    more = {"DMKCL_TEST": function} if function else {}
    more["GCOV_ERROR_FILE"] = os.path.join(TREE, folder, "scratch", "gcov.log")
    return run(["sh", "tests/run.sh", folder, path], limit, KEEP_SCRATCH="1", INTERRUPTS="0", **more)[0] == 0


def source_of(test):
    name = test.split(":")[0]
    return f"tests/test_{name}" if name.endswith(".sh") else f"tests/test_{name}.c"


def all_tests(patterns):
    """"cli.sh" for each script, "units:name" for each test of a program."""
    for file in sorted(os.listdir(os.path.join(ROOT, "tests"))):
        name = re.sub(r"^test_|\.c$", "", file)
        if not file.startswith("test_") or name in NOT_TESTS or not matches(name, patterns):
            continue
        if file.endswith(".sh"):
            yield name
            continue
        text = open(os.path.join(ROOT, "tests", file), encoding="utf-8").read()
        yield from (f"{name}:{function}" for function in re.findall(r"(?:cmocka_unit_test\w*|\bTEST)\((\w+)", text))


def take_directly(patterns, kept):
    """The test programs as they are, as if each reached every line."""
    programs = {t.split(":")[0] for t in all_tests(patterns) if not t.endswith(".sh")}
    for program in sorted(programs):
        build(BUILD, program) or sys.exit(f"{program} does not build as it is")
        passes(BUILD, program, 600) or sys.exit(f"{program} fails as it is")
        begin = time.monotonic()
        passes(BUILD, program, 600) # the first run may have built kernels
        kept["tests"][program] = {"source": digest(source_of(program)), "seconds": time.monotonic() - begin}


def content(path):
    with open(path, "rb") as file:
        return file.read()


def digest(path):
    return hashlib.sha1(content(os.path.join(TREE, path))).hexdigest()[:12]


# ---- which test reaches which line ----------------------------------------------------------


def lines_reached(report):
    """{file: texts of its lines that were run}, from gcov's JSON. A line without a counter goes with the one before;
    one outside functions, "", with the file. Texts, because they stay what they are when lines move."""
    reached = {}
    for text in filter(None, report.split("\n")):
        for file in json.loads(text)["files"]:
            if not file["file"].startswith("src/") or not any(line["count"] for line in file["lines"]):
                continue
            counts = {}
            for line in file["lines"]:
                counts[line["line_number"]] = counts.get(line["line_number"], 0) + line["count"]
            hit, texts = True, {""}
            with open(os.path.join(TREE, file["file"]), encoding="utf-8") as source:
                for number, line in enumerate(source, 1):
                    hit = counts.get(number, hit) > 0
                    texts |= {line.strip()} if hit else set()
                    hit = hit or line.startswith("}")
            reached[file["file"]] = sorted(texts)
    return reached


def record(test):
    """{"source", "seconds", "reached"} of a test that passes on the sources as they are; else "reached" is empty."""
    for base, _, files in os.walk(os.path.join(TREE, COUNTED)):
        for name in files:
            if name.endswith(".gcda"):
                os.remove(os.path.join(base, name))
    begin = time.monotonic()
    passed = passes(COUNTED, test, 900)
    seconds = time.monotonic() - begin
    command = f"find {COUNTED} -name '*.gcda' -exec gcov -t -j {{}} +"
    reached = lines_reached(run(["sh", "-c", command + " 2> /dev/null"], 600)[1]) if passed else {}
    print(f"{'reached by' if passed else 'FAILS: left out:'} {test}: {sum(map(len, reached.values()))} lines, "
          f"{seconds:.1f} s", flush=True)
    return {"source": digest(source_of(test)), "seconds": seconds, "reached": reached}


def tests_for(mutant, kept):
    """Those that reach the line, or one with the name that it defines; those that reach the file where none does, as the
    compiler may have folded the line, and all if that is a header; of a kernel those that launch. The cheapest first."""
    if all("reached" not in r for r in kept["tests"].values()):
        return sorted(kept["tests"], key=lambda t: kept["tests"][t]["seconds"])
    path = "src/device/launch.c" if mutant.path.startswith("kernels/") else mutant.path
    lines = {test: r["reached"][path] for test, r in kept["tests"].items() if path in r["reached"]}
    names = names_of(mutant.old)
    if names:
        named = re.compile(r"\b(" + "|".join(names) + r")\b")
        reaching = [test for test, r in kept["tests"].items()
                    if any(named.search(text) for texts in r["reached"].values() for text in texts)]
    else:
        reaching = [test for test, texts in lines.items() if mutant.old.strip() in texts]
    reaching = reaching or list(lines) or [test for test, r in kept["tests"].items() if r["reached"]]
    noticed = collections.Counter(r["end"] for key, r in kept["mutants"].items() if key.startswith(mutant.path + " "))
    def price(test): # of kernels, whose lines are not counted, those first that go through much of the solver
        r = kept["tests"][test]
        solver = sum(len(texts) for file, texts in r["reached"].items() if file.startswith("src/solver/"))
        return r["seconds"] / (1 + solver ** 2 if mutant.path.startswith("kernels/") else 1)

    return sorted(reaching, key=lambda t: (-noticed[t], price(t)))


# ---- trying ---------------------------------------------------------------------------------


def load_known():
    """{(file, operator, line without blanks and comments): reason}"""
    known, path = {}, os.path.join(HERE, "known.txt")
    if os.path.exists(path):
        for line in open(path, encoding="utf-8"):
            if line.strip() and not line.startswith("#"):
                file, operator, text, reason = (part.strip() for part in line.rstrip("\n").split(" | ", 3))
                known[file, operator, re.sub(r"/\*.*?(\*/|$)|\s", "", text)] = reason
    return known


def still_holds(result, mutant):
    """What it came to, on this file as it is and with the test that noticed it still there."""
    if not result or result["source"] != digest(mutant.path):
        return False
    return result["end"] in (None, "none") or os.path.exists(os.path.join(TREE, source_of(result["end"])))


def changed(text, mutant):
    lines = text.decode().split("\n")
    lines[mutant.line - 1] = lines[mutant.line - 1].replace(mutant.old.strip(), mutant.new.strip() or ";", 1)
    return "\n".join(lines).encode()


def objects_of(path):
    """{object: content} of a source; of a header all, for make knows which."""
    if path.endswith(".h"):
        found = [os.path.join(base, name) for base, _, names in os.walk(os.path.join(TREE, BUILD)) for name in names]
        return {name: content(name) for name in found if name.endswith(".o")}
    made = f"{path[:-1]}o" if path.endswith(".c") else "kernels.o"
    return {name: content(name) for name in [os.path.join(TREE, BUILD, made)]}


def try_mutant(mutant, tests, kept, before, budget):
    """{"source", "end": the test that notices it, None, or "none" for no mutant, "tests": those tried}. The objects of
    the file come back as they were, so that only the archive and one program are made anew."""
    path, tried = os.path.join(TREE, mutant.path), dict(before)
    times, whole, objects = os.stat(path), content(path), objects_of(mutant.path)
    asked = [] if path.endswith(".h") else [os.path.relpath(name, TREE) for name in objects]
    end, spent = None, 0
    try:
        with open(path, "wb") as file:
            file.write(changed(whole, mutant))
        for test in tests:
            spent += kept["tests"][test]["seconds"]
            if budget and spent > budget and test != tests[0]:
                break
            if not build(BUILD, test, *asked) or all(content(name) == old for name, old in objects.items()):
                end = "none"
                break
            tried[test] = digest(source_of(test))
            patience = PATIENCE_KERNEL if mutant.path.startswith("kernels/") else PATIENCE
            if not passes(BUILD, test, patience + 5 * kept["tests"][test]["seconds"]):
                end = test
                break
    finally:
        with open(path, "wb") as file:
            file.write(whole)
        if not mutant.path.endswith(".cl"):
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
            for name in (name for name, old in objects.items() if content(name) != old):
                with open(name, "wb") as file:
                    file.write(objects[name])
    return {"source": digest(mutant.path), "end": end, "tests": tried}


def load(part):
    return json.load(open(KEPT % part, encoding="utf-8")) if os.path.exists(KEPT % part) else {}


def keep(kept, part):
    with open(KEPT % part + ".tmp", "w", encoding="utf-8") as file:
        json.dump(kept[part], file)
    os.replace(KEPT % part + ".tmp", KEPT % part)


def in_time(items, stop):
    """The items until the time is over."""
    for item in items:
        if time.monotonic() > stop:
            print("# the time is over: the next run goes on here")
            sys.exit(0)
        yield item


def tell(mutant):
    return f"{mutant.path}:{mutant.line}: {mutant.operator}: {mutant.old.strip()} -> {mutant.new.strip() or ';'}"


def sort_out(drawn, known, kept):
    """{room: Counter of the columns}, with "~all"; survivors; those that are known, with the reasons."""
    table, survivors, reasons = collections.defaultdict(collections.Counter), [], []
    for mutant in drawn:
        result, reason = kept["mutants"].get(mutant.key), reason_of(mutant, known)
        if not reason and (not still_holds(result, mutant) or result["end"] == "none"):
            continue
        column = "known" if reason else "died" if result["end"] else "survived"
        for room in (room_of(mutant.path), "~all"):
            table[room].update(["tried", column])
        if reason:
            reasons.append((mutant, reason))
        elif column == "survived":
            survivors.append((mutant, len(result["tests"])))
    return table, survivors, reasons


def share_of(row):
    return 100 * row["died"] / max(1, row["tried"] - row["known"])


def print_table(drawn, known, kept, floor):
    """Returns the number of survivors beyond the floor."""
    table, survivors, _ = sort_out(drawn, known, kept)
    for mutant, n_tests in survivors:
        print(f"SURVIVED {tell(mutant)}  [{n_tests} tests]")
    print(f"\n{'room':12}" + "".join(f"{c:>9}" for c in COLUMNS) + f"{'share':>9}")
    for room, row in sorted(table.items()):
        print(f"{room.strip('~'):12}" + "".join(f"{row[c]:9}" for c in COLUMNS) + f"{share_of(row):8.1f}%")
    total = table["~all"]
    failed = 0 if total["died"] >= floor * (total["tried"] - total["known"]) else total["survived"]
    print(f"# tried {total['tried']}: failed {failed}")
    return failed


def write_page(path, arguments, drawn, known, kept):
    table, survivors, reasons = sort_out(drawn, known, kept)
    last = ["git", "log", "-1", "--format=%h", "--", "src", "kernels"]
    commit = subprocess.check_output(last, cwd=ROOT, text=True).strip()
    lines = f"""# Mutants

Small wrong changes of the sources, one at a time, and whether a test of `make test` notices: `make mutate`
(`mutate.py`). Sources of {commit}, `--count {arguments.count} --seed {arguments.seed}`: {len(drawn)} drawn, half of \
them in equal parts from
the rooms, half by their sizes; those that do not compile, or to the same object, are none and not counted. Known: cannot
be noticed, or by other checks only. Share: of those that are not known, how many died.

| room | tried | died | known | survived | share |
|---|---:|---:|---:|---:|---:|""".split("\n")
    lines += ["| " + " | ".join([room.strip("~")] + [str(row[c]) for c in COLUMNS] + [f"{share_of(row):.1f} %"]) + " |"
              for room, row in sorted(table.items())]
    quoted = lambda mutant: "`" + tell(mutant).replace("|", "\\|") + "`"
    lines += ["", "Survivors:", ""] + [f"- {quoted(m)}" for m, _ in survivors]
    lines += ["", "Known, with the reason:", ""] + [f"- {quoted(m)}: {reason}" for m, reason in reasons]
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


def reason_of(mutant, known):
    """Of the operator wherever it stands in the line, or at its one place, as in "double#1"."""
    name, line = mutant.operator, re.sub(r"\s", "", mutant.old)
    return known.get((mutant.path, name, line)) or known.get((mutant.path, name.split("#")[0], line))


def main():
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143)) # what runs goes with it
    parser = argparse.ArgumentParser()
    for name, kind, value in (("count", int, 300), ("seed", int, 1), ("rooms", str, ""), ("files", str, ""),
                              ("tests", str, ""), ("only", str, ""), ("page", str, ""), ("budget", float, 60),
                              ("seconds", float, 1e9), ("floor", float, 0.95)):
        parser.add_argument(f"--{name}", type=kind, default=value)
    for name in ("constants", "list", "table", "direct"):
        parser.add_argument(f"--{name}", action="store_true")
    arguments = parser.parse_args()
    drawn, known, stop = draw(arguments), load_known(), time.monotonic() + arguments.seconds
    if arguments.list:
        for mutant in drawn:
            print(f"{mutant.path}:{mutant.line}: {mutant.operator}: {mutant.new.strip()}")
        return 0
    kept = {part: load(part) for part in ("tests", "mutants")}
    copy_tree() # what it came to holds for files as they are now
    for test in [t for t in kept["tests"] if not os.path.exists(os.path.join(TREE, source_of(t)))]:
        del kept["tests"][test]
    if arguments.page:
        write_page(arguments.page, arguments, drawn, known, kept)
    if arguments.table:
        return print_table(drawn, known, kept, arguments.floor) > 0
    if arguments.direct:
        kept = {"tests": {}, "mutants": {}}
        take_directly(arguments.tests, kept)
    else:
        wanted = [t for t in all_tests(arguments.tests)
                  if kept["tests"].get(t, {}).get("source") != digest(source_of(t))]
        if wanted:
            build(COUNTED)
        for test in in_time(wanted, stop):
            kept["tests"][test] = record(test)
            keep(kept, "tests")
        build(BUILD)
    drawn.sort(key=lambda m: (m.key in kept["mutants"], m.path.endswith(".cl"))) # survivors again at the end
    for n, mutant in enumerate(in_time(drawn, stop), 1):
        result = kept["mutants"].get(mutant.key)
        holds, reason = still_holds(result, mutant), reason_of(mutant, known)
        if reason or holds and result["end"]:
            continue
        before = result["tests"] if holds else {}
        tests = [t for t in tests_for(mutant, kept) if before.get(t) != digest(source_of(t))]
        if holds and not tests:
            continue
        result = kept["mutants"][mutant.key] = try_mutant(mutant, tests, kept, before, arguments.budget)
        if not arguments.direct:
            keep(kept, "mutants")
        word = "died" if result["end"] else "SURVIVED"
        print(f"{n}/{len(drawn)} {word} {tell(mutant)}  [{result['end']}]", flush=True)
    return print_table(drawn, known, kept, arguments.floor) > 0


if __name__ == "__main__":
    sys.exit(main())
