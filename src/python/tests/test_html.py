"""The page of `export_html`, in a headless Chromium that has no network."""

import os
import re
import shutil

import numpy as np
import pytest

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
    assert [p.name for p in page.parent.iterdir()] == [page.name]


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


def test_nothing_is_left_of_a_failed_export(result, tmp_path):
    with pytest.raises(OSError):
        result.export_html(tmp_path / "no-such-folder" / "x.html")
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError):
        result.export_html(tmp_path / "folder")
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]
