# The paper's experiments on the coarsest meshes: the table stands beside exact values, the figures are
# not blank.
. tests/tap.sh
out=$work/paper
need_packages "the paper's experiments"
check 'the experiments run' build/pyenv/bin/python bench/paper.py --quick --program "$tool" \
    --out "$out" --small "$out/small"
for part in '| torus, p = (3, 0, 0) | 5,424 |' '| 20.5331 | 2 (2) | 2 (2) |' '| quartic | 68,352 |' \
    '| 5,424 | 1e-03 |'; do
    check "the table has $part" grep -F "$part" "$out/table.md"
done
for name in torus tangent ellipsoid quartic; do
    check "$name.png is a picture" build/pyenv/bin/python -c '
import sys
from PIL import Image
for name in sys.argv[1:]:
    colours = Image.open(name).convert("RGB").getcolors(1 << 24)
    assert len(colours) > 60, f"{len(colours)} colours"
' "$out/$name.png" "$out/small/$name.png"
done
tap_end
