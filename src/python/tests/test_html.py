"""The page of `export_html`, in a headless Chromium that has no network."""

import errno
import base64
import io
import json
import os
import re
import shutil
import subprocess
import threading
import time

import numpy as np
import pytest
from PIL import Image

import dmkcl
from browser import Browser

CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")


@pytest.fixture(scope="module")
def page(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("html") / "torus.html"
    result.export_html(path, title="Torus <1> & more")
    return path


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(CHROMIUM, tmp_path_factory.mktemp("chromium")) as running:
        yield running


def test_one_file_without_addresses(page):
    text = page.read_text()
    assert "Torus &lt;1&gt; &amp; more" in text and "@" not in re.sub(r"@media", "", text[:3000])
    assert not re.search(r"https?://|src=|@import", text)
    assert re.search(r"Cost of the discrete problem between 32\d\.\d+ and 32\d\.\d+; integral of the distance 321\.2\d+,", text)
    assert [p.name for p in page.parent.iterdir()] == [page.name]


def test_links_pipes_and_other_files_stay(result, page, tmp_path):
    result.export_html(tmp_path / "a.html", title="Torus <1> & more")
    (tmp_path / "a.html").chmod(0o640)
    (tmp_path / "a.html.part").write_text("mine")
    (tmp_path / "link.html").symlink_to("a.html")
    (tmp_path / "a.html").write_text("old")
    result.export_html(tmp_path / "link.html", title="Torus <1> & more")
    assert (tmp_path / "link.html").is_symlink()
    assert (tmp_path / "a.html").read_text() == page.read_text()
    assert (tmp_path / "a.html").stat().st_mode & 0o777 == 0o640
    assert (tmp_path / "a.html.part").read_text() == "mine"
    os.mkfifo(tmp_path / "pipe.html")
    with subprocess.Popen(["cat", tmp_path / "pipe.html"], stdout=subprocess.PIPE) as cat:
        writer = threading.Thread(target=result.export_html, args=(tmp_path / "pipe.html",), daemon=True)
        writer.start()
        try:
            assert b"</html>" in cat.communicate(timeout=20)[0]
        finally:
            cat.kill()
        writer.join(20)
    assert (tmp_path / "pipe.html").is_fifo()
    assert sorted(os.listdir(tmp_path)) == ["a.html", "a.html.part", "link.html", "pipe.html"]


def test_names_and_titles_of_any_kind(result, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in (b"bytes.html", b"\xff.html", "\udcfe.html"):
        result.export_html(name, title="half of a pair: \ud800")
    assert sorted(os.listdir(b".")) == [b"bytes.html", b"\xfe.html", b"\xff.html"]
    assert "<h1>half of a pair: ?</h1>" in (tmp_path / "bytes.html").read_text()
    for name, title, words in (("a\0.html", None, "NUL"), (3, None, "name of a file"), ("a.html", 3, "title = 3")):
        with pytest.raises(dmkcl.ArgumentError, match=words):
            result.export_html(name, title=title)
    with pytest.raises(dmkcl.ArgumentError, match="title = b'x'"):
        result.view(title=b"x")
    assert len(os.listdir(tmp_path)) == 3


@pytest.mark.parametrize("name", ["", ".", "missing/a.html"])
def test_what_cannot_be_written_is_named(result, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(dmkcl.FileError, match="cannot write: "):
        result.export_html(name)
    assert os.listdir(tmp_path) == []


@needs_browser
def test_the_page_draws(browser, page):
    browser.open(page)
    picture = browser.screenshot()
    colours = np.unique(picture.reshape(-1, 3), axis=0)
    assert len(colours) > 500
    shown = (picture != 255).any(axis=2).mean()
    assert 0.1 < shown < 0.9
    red = (picture[..., 0] > 150) & (picture[..., 1] < 100) & (picture[..., 2] < 100)
    assert red.sum() > 300
    assert browser.complaints == [] and browser.requests == [page.as_uri()]
    if os.environ.get("DMKCL_KEEP"):
        shutil.copy(browser.picture, os.environ["DMKCL_KEEP"])


@needs_browser
def test_hands_move_it(browser, page):
    browser.open(page)
    first = browser.screenshot()
    # The source is in front.
    yellow = (first[..., 0] > 180) & (first[..., 1] > 110) & (first[..., 2] < 90)
    assert yellow.sum() > 20
    browser.drag((520, 300), (400, 340))
    turned = browser.screenshot()
    assert (first != turned).any(axis=2).mean() > 0.05
    browser.wheel((400, 300), -600)
    near = browser.screenshot()
    assert (near != 255).any(axis=2).sum() > 1.2 * (turned != 255).any(axis=2).sum()
    browser.double_click((400, 300))
    assert (browser.screenshot() != first).any(axis=2).mean() < 0.001
    browser.key("ArrowLeft")
    assert (browser.screenshot() != first).any(axis=2).mean() > 0.02
    assert browser.complaints == []


def middle(picture):
    """Of what is no background: its pixels' mean place, above the words at the foot and right of those at the head."""
    shown = (picture[100:520] != 255).any(axis=2)
    y, x = np.nonzero(shown)
    return x.mean(), y.mean() + 100


@needs_browser
def test_shift_and_drag_move(browser, page):
    browser.open(page)
    first = browser.screenshot()
    browser.drag((400, 300), (430, 270), shift=True)
    moved = browser.screenshot()
    x, y = middle(first)
    assert middle(moved) == pytest.approx((x + 30, y - 30), abs=8)


@needs_browser
def test_keys_move_it_nearer(browser, page):
    browser.open(page)
    size = []
    for key in ("ArrowLeft", *"++--"):
        browser.key(key)
        size.append((browser.screenshot() != 255).any(axis=2).sum())
    assert size[0] < size[1] < size[2] > size[3] > size[4] == pytest.approx(size[0], rel=0.01)


@needs_browser
def test_the_focus_is_seen(browser, page):
    browser.open(page)
    blue = lambda: (np.abs(browser.screenshot()[:, 1] - (51, 102, 204)).max(axis=1) < 3).mean()  # noqa: E731
    assert blue() == 0
    browser.click_at((430, 300))
    assert blue() == 0, "not of a mouse"
    browser.press_key("Tab")
    browser.value("document.getElementById('view').focus()")
    assert blue() > 0.9


@needs_browser
@pytest.mark.parametrize("box", ["log", "lines", "cut", "hidden"])
def test_boxes_change_it(browser, page, box):
    browser.open(page)
    if box == "cut":  # which lies on the other side
        browser.drag((620, 300), (240, 300))
    first = browser.screenshot()
    browser.click(box)
    assert (browser.screenshot() != first).any(axis=2).mean() > 0.002
    assert browser.complaints == []


@needs_browser
@pytest.mark.parametrize("quantity", ["distance", "potential", "strength"])
def test_colours_can_be_chosen(browser, page, quantity):
    browser.open(page)
    first = browser.screenshot()
    browser.choose("colour", quantity)
    assert (browser.screenshot() != first).any(axis=2).mean() > 0.05
    assert browser.value("document.querySelector('#bar b').textContent").startswith(quantity)
    ticks = browser.value("[...document.querySelectorAll('#ticks span')].map(t => t.textContent).join()")
    values = [abs(float(t)) for t in ticks.split(",")]
    assert 3 <= len(values) <= 9
    mantissas = {f"{value:.6e}"[:3] for value in values if value}
    assert mantissas <= {f"{k}.0" for k in range(1, 10)} | {"1.2", "1.4", "1.5", "2.5"}, "round numbers"
    assert browser.complaints == []


def said(browser, identity):
    """What stands there, once something does."""
    for _ in range(20):
        text = browser.value(f"document.getElementById('{identity}').innerText")
        if text:
            return text
        time.sleep(0.05)
    return ""


@needs_browser
def test_the_value_under_the_pointer(browser, page, result):
    browser.open(page)
    browser.mouse("mouseMoved", (430, 300))
    found = dict(line.rsplit(" ", 1) for line in said(browser, "tip").splitlines())
    face = int(found["triangle"])
    distances = result.distance[result.mesh.faces[face]]
    assert distances.min() * 0.999 <= float(found["distance"]) <= distances.max() * 1.001
    assert float(found["density"]) == pytest.approx(result.density[face], rel=1e-3)
    potentials = result.potential[result.mesh.faces[face]]
    assert potentials.min() * 1.001 <= float(found["potential"]) <= potentials.max() * 0.999


def lengths(browser, at):
    browser.click_at(at)
    return json.loads(browser.value("document.getElementById('picked').dataset.lengths"))


@needs_browser
def test_a_click_shows_minimal_geodesics(browser, page, result):
    browser.open(page)
    first = browser.screenshot()
    found = lengths(browser, (430, 300))
    said = browser.value("document.getElementById('picked').textContent")
    vertex = int(re.search(r"vertex (\d+)", said)[1])
    assert found == [pytest.approx(result.distance[vertex], rel=1e-5)]
    assert (browser.screenshot() != first).any(axis=2).mean() > 0.002
    # On the locus there are two: its opposite meridian, from behind.
    browser.drag((620, 300), (240, 300))
    several = [lengths(browser, (x, 290)) for x in range(270, 330, 4)]
    assert any(len(found) == 2 and abs(found[0] - found[1]) < 0.1 for found in several)
    assert browser.complaints == []


@needs_browser
def test_the_right_button_picks_nothing(browser, page):
    browser.open(page)
    browser.right_click((430, 300))
    assert browser.value("document.getElementById('picked').textContent") == ""
    assert browser.value("document.getElementById('picked').dataset.lengths") is None


def yellow(browser):
    """Where the source is on the screen."""
    picture = browser.screenshot()
    y, x = np.nonzero((picture[..., 0] > 180) & (picture[..., 1] > 110) & (picture[..., 2] < 90))
    return x.mean(), y.mean()


@needs_browser
def test_around_the_source_there_is_no_locus(browser, page):
    browser.open(page)
    x, y = yellow(browser)
    for i in range(24):
        angle = 2 * np.pi * i / 24
        assert len(lengths(browser, (x + (4 + i) * np.cos(angle), y + (4 + i) * np.sin(angle)))) == 1, i


def ring(n=24):
    """Around the z axis, of radius 1, 0.25 high; vertex 0 at (1, 0, 0), on the border."""
    angle = 2 * np.pi / n * np.arange(n)
    V = np.column_stack([np.tile(np.cos(angle), 2), np.tile(np.sin(angle), 2), np.repeat([0, 0.25], n)])
    v, after = np.arange(n), (np.arange(n) + 1) % n
    return V, np.vstack([np.column_stack([v, after, after + n]), np.column_stack([v, after + n, v + n])])


@needs_browser
def test_directions_at_a_border_do_not_go_round(browser, tmp_path):
    """From a vertex of the border ways to the left and to the right meet opposite, half a turn, all there is, apart."""
    dmkcl.CutLocus(*ring()).solve(vertex=0).export_html(tmp_path / "ring.html")
    browser.open(tmp_path / "ring.html")
    picture = browser.screenshot()
    y, x = np.nonzero((picture[..., 0] > 150) & (picture[..., 1] < 100) & (picture[..., 2] < 100))
    assert lengths(browser, (x.mean() - 4, y.mean())) == pytest.approx([np.pi, np.pi], rel=0.2)


@needs_browser
@pytest.mark.filterwarnings("ignore:the mesh is in 2 pieces")
def test_another_component_is_not_joined(browser, small, tmp_path):
    V, F = small
    two = np.vstack([V, V + (0, 3, 0)]), np.vstack([F, F + len(V)])
    dmkcl.CutLocus(*two).solve(point=(1, 0, 0)).export_html(tmp_path / "two.html")
    browser.open(tmp_path / "two.html")
    x, y = yellow(browser)
    for at, joined in (((x, y), True), ((x + 30, y), True), ((800 - x, y), False)):
        browser.click_at(at)
        browser.mouse("mouseMoved", at)
        words = said(browser, "tip")
        assert ("not joined" in words) != joined and ("distance" in words) == joined
        assert ("Minimal geodesic" in said(browser, "picked")) == joined


@needs_browser
def test_geodesics_bend_at_saddle_vertices(browser, tmp_path):
    mesh = dmkcl.surfaces.torus(n_triangles=300)
    last = dmkcl.Geodesics(mesh, 0)._arrivals["pseudo_source"]
    assert (last >= 0).any()
    result = dmkcl.CutLocus(mesh).solve(vertex=0)
    result.export_html(tmp_path / "coarse.html")
    browser.open(tmp_path / "coarse.html")
    browser.drag((620, 300), (240, 420))  # those that bend arrive on the other side
    seen = set()
    for x in range(200, 600, 25):
        for y in (230, 300, 370):
            browser.click_at((x, y))
            said = browser.value("document.getElementById('picked').textContent")
            for vertex in map(int, re.findall(r"(?<=vertex )\d+|(?<=vertices )\d+", said)):
                length = json.loads(browser.value("document.getElementById('picked').dataset.lengths"))[0]
                assert length == pytest.approx(result.distance[vertex], rel=1e-4)
                seen.add(vertex)
    assert len(seen) > 15 and (last[list(seen)] >= 0).sum() >= 2


@needs_browser
def test_the_slider_shows_weak_branches(browser, page):
    browser.open(page)
    browser.drag((620, 300), (240, 330))
    first = browser.screenshot()
    browser.slide("least", 0)
    more = browser.screenshot()
    assert (more != first).any(axis=2).sum() > 20
    browser.slide("least", 1000)
    assert (browser.screenshot() != more).any(axis=2).sum() > 20


@needs_browser
def test_fingers(browser, page):
    browser.open(page)
    first = browser.screenshot()
    browser.fingers([[(350, 300), (450, 300)], [(250, 300), (550, 300)]])
    near = browser.screenshot()
    assert (near != 255).any(axis=2).sum() > 1.2 * (first != 255).any(axis=2).sum()
    browser.fingers([[(400, 300)], [(430, 300)], [(480, 320)]])  # one turns
    turned = browser.screenshot()
    assert (turned != near).any(axis=2).mean() > 0.05
    browser.fingers([[(300, 300), (500, 300)], [(350, 330), (550, 330)]])  # two move
    assert (browser.screenshot() != turned).any(axis=2).mean() > 0.05
    assert browser.complaints == []


@needs_browser
def test_a_tap_shows_values_and_geodesics(browser, page):
    browser.open(page)
    browser.drawn(lambda: browser.fingers([[(420, 330)]]))
    assert "Minimal geodesic" in browser.value("document.getElementById('picked').textContent")
    assert browser.value("document.getElementById('tip').hidden") is False
    assert "density" in browser.value("document.getElementById('tip').textContent")
    browser.fingers([[(420, 330)], [(470, 330)]])
    assert browser.value("document.getElementById('tip').hidden") is True


@needs_browser
def test_the_saved_picture_has_title_and_scale(browser, page):
    browser.open(page)
    browser.value(
        "HTMLAnchorElement.prototype.click = function () { document.title = this.href; }"
    )
    browser.click("save")
    saved = np.asarray(Image.open(io.BytesIO(base64.b64decode(browser.value("document.title").split(",")[1]))))
    assert saved.shape[:2] == (600, 800)
    assert (saved[10:40, 10:200, :3] < 100).any() and (saved[45:240, 766:784, :3] < 120).any()


@needs_browser
def test_a_locus_that_is_a_point(browser, small, tmp_path):
    result = dmkcl.CutLocus(small).solve(point=(0, 0, 1))
    result.export_html(tmp_path / "sphere.html")
    browser.open(tmp_path / "sphere.html")
    assert browser.complaints == []


@needs_browser
def test_view_of_a_notebook(browser, result, tmp_path):
    cell = result.view(height=400)._repr_html_()
    (tmp_path / "notebook.html").write_text(f"<!DOCTYPE html><title>n</title>{cell}")
    browser.open(tmp_path / "notebook.html", frame=True)
    assert (browser.screenshot() != 255).any(axis=2).mean() > 0.02
    assert browser.complaints == []


@needs_browser
def test_huge_and_far_coordinates(browser, small, tmp_path):
    V = small.vertices * 1e30 + 1e31
    dmkcl.CutLocus(V, small.faces).solve(vertex=0).export_html(tmp_path / "huge.html")
    browser.open(tmp_path / "huge.html")
    assert (browser.screenshot() != 255).any(axis=2).mean() > 0.1
    assert browser.complaints == []


@needs_browser
def test_any_unit(browser, small, tmp_path):
    """Density, lines of equal distance and locus look the same where single precision does not hold their values."""
    seen = []
    for unit in (1, 1e-40, 1e40):
        dmkcl.CutLocus(unit * small.vertices, small.faces).solve(vertex=0).export_html(tmp_path / "x.html")
        browser.open(tmp_path / "x.html")
        seen.append(browser.screenshot()[120:-80, :-160].astype(int))
    for other in seen[1:]:
        assert (abs(other - seen[0]) > 30).any(axis=2).mean() < 0.005
    assert browser.complaints == []


def test_nothing_is_left_of_a_failed_export(result, tmp_path):
    with pytest.raises(dmkcl.FileError, match=r"folder.x\.html: cannot write: No such file") as caught:
        result.export_html(tmp_path / "no-such-folder" / "x.html")
    assert isinstance(caught.value, FileNotFoundError) and caught.value.errno == errno.ENOENT
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError):
        result.export_html(tmp_path / "folder")
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]
