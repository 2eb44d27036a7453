# What the tool prints and writes, word for word and number for number: tests/data/pinned-cli.txt is a session of
# commands with their output. Times, memory and devices are left out; numbers may differ by 1e-5 and one in their last
# digit, counts of CG by 2, as from device to device.
# After a change that is meant to change them: PINNED_WRITE=1 bash tests/test_pinned.sh (and read what git says).
. tests/tap.sh

cat > "$work/session.py" << 'EOF'
import os, re, shlex, subprocess, sys, zlib
session, tool, work = sys.argv[1:]
number = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*(?:e[-+]?\d+)?|\.\d+)(?![\w.])")
# What differs from run to run, in reports and in the lines of a summary.
stages = "read|device|setup|start|solve|certify|locus|write|total|distance|path|cut|order|seconds|peak_memory"
masks = [(rf'"({stages})": [-+.0-9e]+', r'"\1": T'), (r'"(platform|driver|dmkcl)": ".*?"', r'"\1": "D"'),
         (r'"name": "(?!ellipsoid|sphere).*?"', '"name": "D"'), (r'"compute_units": \d+', '"compute_units": N'),
         (r"^device .*", "device D"), (r"^time .*", "time T"), (r"^ +(certify|locus|write) .*memory .*", "T"), (r"\b[.0-9]+ m?s\b", "T s")]

def masked(text):
    lines = text.replace(work, "WORK").split("\n")
    for pattern, instead in masks:
        lines = [re.sub(pattern, instead, line) for line in lines]
    return [line.rstrip() for line in lines if line.strip()]

def show(path):
    """A file: its lines, or of a long one their number, a sum of what is no number, and one over the numbers, each
    with a weight of its own."""
    lines = masked(open(path, encoding="latin-1").read())
    if len(lines) <= 100:
        return lines
    text = re.sub(r"\b([ML])(?=[-\d])", r"\1 ", "\n".join(lines)) # of drawings
    values = [float(x) for x in number.findall(text)]
    weight = [0.5 + 0.6180339887 * (i + 1) % 1 for i in range(len(values))]
    return [f"{len(lines)} lines of crc {zlib.crc32(number.sub('#', text).encode()):08x}; {len(values)} numbers, sum "
            f"{sum(w * x for w, x in zip(weight, values)):.9g}, of sizes {sum(w * abs(x) for w, x in zip(weight, values)):.9g}"]

def run(command):
    words = shlex.split(command)
    if words[0] == "show":
        path = os.path.join(work, words[1])
        return ["| " + line for line in show(path)] if os.path.exists(path) else ["not there"]
    process = subprocess.run(["sh", "-c", re.sub(r"\bdmkcl\b", shlex.quote(tool), command)], cwd=work, stdin=subprocess.DEVNULL,
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=60)
    return ([f"= {process.returncode}"] + ["| " + line for line in masked(process.stdout)] +
            ["! " + line for line in masked(process.stderr)])

def last_digit(text):
    digits, _, power = text.partition("e")
    return 10.0 ** (int(power or 0) - len(digits.partition(".")[2])) if re.search("[.e]", text) else 0

def same(a, b):
    if number.sub("#", a) != number.sub("#", b):
        return False
    free = 2 if re.search('CG|"(cg_iterations|v_cycles)"|^. acl ', a) else 0 # of counts
    return all(abs(float(x) - float(y)) <= 1e-6 + 1e-5 * abs(float(x)) + 1.01 * last_digit(x)
               if last_digit(x) else abs(int(x) - float(y)) <= (1e-6 if last_digit(y) else free)
               for x, y in zip(number.findall(a), number.findall(b)))

expected, command = {}, None
for line in open(session, encoding="utf-8").read().split("\n"):
    if line.startswith("$ "):
        command = line[2:]
        assert command not in expected, command
        expected[command] = []
    elif line and not line.startswith("#"):
        expected[command].append(line)
if os.environ.get("PINNED_WRITE"):
    head = [line for line in open(session, encoding="utf-8").read().split("\n") if line.startswith("#")]
    text = head + [line for c in expected for line in ["$ " + c] + run(c)]
    open(session, "w", encoding="utf-8").write("\n".join(text) + "\n")
    sys.exit("written")
for n, (command, lines) in enumerate(expected.items(), 1):
    said = run(command)
    if len(said) == len(lines) and all(map(same, lines, said)):
        print(f"ok {n} - {command}")
        continue
    print(f"not ok {n} - {command}")
    for i in range(max(len(said), len(lines))):
        a, b = (x[i] if i < len(x) else "nothing" for x in (lines, said))
        if not same(a, b):
            print(f"# expected {a}\n# but got  {b}")
print(f"1..{len(expected)}")
EOF
cp meshes/*.off "$work"
exec python3 "$work/session.py" tests/data/pinned-cli.txt "$PWD/$tool" "$work"
