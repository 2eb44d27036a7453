"""Pictures by PyVista and Matplotlib."""

import numpy as np
import pytest

import dmkcl
from dmkcl import plotting
from dmkcl._colour import density_map

matplotlib = pytest.importorskip("matplotlib")
pytest.importorskip("matplotlib.image")
pytest.importorskip("matplotlib.pyplot")
pyvista = pytest.importorskip("pyvista")


def near(picture, colour, within=60):
    """Number of pixels whose colour is near this one."""
    return int((np.abs(picture[..., :3].astype(int) - colour).max(axis=2) < within).sum())


def test_colours_step_evenly():
    colours = density_map(256)
    assert colours.min() >= 0 and colours.max() <= 1
    # Lightness L* of CIELAB falls by nearly equal steps.
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    lightness = 116 * np.cbrt(linear @ [0.2126, 0.7152, 0.0722]) - 16
    steps = np.diff(lightness)
    assert steps.max() < 0 and steps.min() > 1.6 * steps.mean()


def test_plot(tmp_path, result):
    result.plot(screenshot=tmp_path / "picture.png")
    picture = pyvista.read(tmp_path / "picture.png")
    pixels = np.asarray(picture.active_scalars).reshape(
        picture.dimensions[1], picture.dimensions[0], -1
    )
    white = near(pixels, (255, 255, 255), 2)
    assert 0.2 * pixels[..., 0].size < white < 0.9 * pixels[..., 0].size
    assert near(pixels, (180, 25, 28)) > 500  # the locus


def test_plot_shows_both_sides(tmp_path, result):
    result.plot(screenshot=tmp_path / "picture.png")
    pixels = matplotlib.image.imread(tmp_path / "picture.png") * 255
    left, right = np.split(pixels, 2, axis=1)
    assert near(left, (240, 180, 25)) > 30 > near(right, (240, 180, 25))  # the source
    assert near(right, (180, 25, 28)) > 1.3 * near(left, (180, 25, 28))  # the locus


@pytest.mark.parametrize("low, high, log", [(0.036, 32.7, True), (1e-3, 1, True), (0, 7.02, False), (-6.9, 0, False), (2.1, 2.3, False)])
def test_scales_are_round(low, high, log):
    a, b, n = plotting.round_scale(low, high, log)
    labels = np.geomspace(a, b, n) if log else np.linspace(a, b, n)
    assert a <= low < high <= b and 2 <= n <= 9
    assert all(float(f"{label:.3g}") == pytest.approx(label) for label in labels)
    assert log or b - a < 1.7 * (high - low)


def test_plot_from_the_source(result):
    plotter = result.plot(plotter=pyvista.Plotter(off_screen=True), show=False)
    plotter.view_vector((1, 0, 0.3))
    pixels = plotter.screenshot(return_img=True)
    assert near(pixels, (240, 180, 25)) > 30
    plotter.close()


def test_plot_options(result):
    plotter = result.plot(show=False, log=False, contours=0, locus=False, source=False)
    assert len(plotter.actors) <= 2
    mine = pyvista.Plotter(off_screen=True)
    assert result.plot(plotter=mine, show=False, scalars="distance", cmap="viridis") is mine
    assert result.plot(plotter=mine, show=False, mesh_options={"show_edges": True}) is mine
    plotter.close()
    mine.close()


@pytest.mark.parametrize(
    "given, words",
    [
        (dict(views=3), "views = 3: expected 1 or 2"),
        (dict(views=2.0), "views = 2.0: expected a whole number"),
        (dict(contours=-1), "contours = -1: expected a number from 0"),
        (dict(scalars="foo"), "scalars = 'foo': expected one of acl, distance, gradient, mu, u"),
        (dict(scalars=None), "scalars = None: expected one of acl"),
        (dict(clim=(3, 1)), r"clim = \(3, 1\): expected two numbers above 0, the smaller one first"),
        (dict(clim=(1, 1)), "two numbers above 0, the smaller"),
        (dict(clim=(0, 1)), "two numbers above 0, the smaller"),
        (dict(clim=(0, np.inf), log=False), "two finite numbers, the smaller one first"),
        (dict(clim=(np.nan, 1), scalars="distance"), "two finite numbers, the smaller"),
        (dict(clim=(1, 2, 3)), "clim = "),
        (dict(clim=5), "clim = 5: expected two"),
        (dict(clim="ab"), "clim = 'ab': expected two"),
        (dict(mesh_options={"scalars": "u"}), 'mesh_options has "scalars": give scalars=..., which sets'),
        (dict(mesh_options={"clim": (1, 2)}), 'mesh_options has "clim": give clim=..., which sets'),
        (dict(mesh_options={"cmap": "gray"}), 'mesh_options has "cmap": give cmap=..., which sets'),
        (dict(mesh_options={"log_scale": False}), 'mesh_options has "log_scale": give log=..., which sets'),
        (dict(mesh_options=[("opacity", 0.5)]), "mesh_options = .*: expected a dict, as"),
        (dict(mesh_options={"opacty": 0.5}), "mesh_options = {'opacty': 0.5}: .*opacty"),
        (dict(cmap="no such map"), "cmap = 'no such map': .*no such map"),
        (dict(cmap=""), "cmap = '': "),
        (dict(plotter=5), "plotter = 5: expected a pyvista.Plotter"),
        (dict(log="no"), "log = 'no': expected True or False"),
        (dict(locus=np.zeros(2)), r"locus = array\(.*: expected True or False"),
        (dict(screenshot="picture.odt"), "screenshot = 'picture.odt': .*odt"),
        (dict(screenshot=""), "screenshot = '': expected a name with a suffix"),
        (dict(screenshot="picture"), "screenshot = 'picture': expected a name with a suffix, as .png"),
    ],
)
def test_plot_options_that_are_wrong(result, given, words):
    with pytest.raises(dmkcl.ArgumentError, match=words):
        result.plot(show=False, **given)


def test_a_picture_that_cannot_be_written(result, tmp_path):
    with pytest.raises(FileNotFoundError, match="none/a.png: cannot write: No such file or directory") as error:
        result.plot(screenshot=tmp_path / "none" / "a.png")
    assert isinstance(error.value, dmkcl.FileError)


@pytest.mark.parametrize(
    "kind, given, words",
    [
        ("tangent", dict(ax=5), "ax = 5: expected axes of Matplotlib"),
        ("tangent", dict(line_options=[1]), r"line_options = \[1\]: expected a dict, as {'lw': 2}"),
        ("tangent", dict(line_options={3: 4}), "line_options = {3: 4}: expected a dict"),
        ("tangent", dict(line_options={"clour": 4}), "line_options = {'clour': 4}: .*clour"),
        ("history", dict(ax=[5]), r"ax = \[5\]: expected axes of Matplotlib"),
    ],
)
def test_axes_and_lines_that_are_wrong(result, kind, given, words):
    with pytest.raises(dmkcl.ArgumentError, match=words):
        getattr(result, "plot_" + kind)(**given)
    matplotlib.pyplot.close("all")


def test_axes_of_another_kind_are_refused(result):
    """On others than polar ones the disk would be cut off along a chord."""
    from matplotlib import pyplot

    flat, polar = pyplot.figure().add_subplot(), pyplot.figure().add_subplot(projection="polar")
    with pytest.raises(dmkcl.ArgumentError, match='expected axes with projection="polar", not "rectilinear"'):
        result.plot_tangent(ax=flat)
    with pytest.raises(dmkcl.ArgumentError, match='expected axes with projection="rectilinear", not "polar"'):
        result.plot_history(ax=polar)
    assert not flat.lines and not polar.lines
    assert result.plot_tangent(ax=polar) is polar
    pyplot.close("all")


def test_the_history_keeps_the_ticks_of_its_axes(result):
    from matplotlib import pyplot

    _, (own, logarithmic) = pyplot.subplots(2)
    own.set_xticks([1, 2.5])
    logarithmic.set_xscale("log")
    for axes in own, logarithmic:
        assert result.plot_history(ax=axes) is axes
    assert list(own.get_xticks()) == [1, 2.5] and logarithmic.get_xscale() == "log"
    pyplot.close("all")


def test_the_scale_of_a_plot(result):
    data = result.to_pyvista()
    given = plotting._colour_settings(data, "mu", False, None, np.array([-1, 2]))
    assert given["clim"] == (-1, 2)
    # Of vectors the colours tell the lengths, whatever their directions.
    assert plotting._colour_settings(data, "gradient", True, None, None)["clim"] == [0, 1.2]


def test_plot_of_a_point_and_of_components(small):
    V, F = small
    both = dmkcl.CutLocus(np.vstack([V, V + [5, 0, 0]]), np.vstack([F, F + len(V)]))
    plotter = both.solve(vertex=0).plot(show=False)
    assert len(plotter.actors) >= 4  # surface, contours, locus, source
    plotter.close()


def test_plot_tangent(result):
    from matplotlib import pyplot

    axes = result.plot_tangent(line_options={"linewidth": 2})
    line = axes.lines[0]
    assert line.get_linewidth() == 2
    angle, time = line.get_data()
    assert angle[-1] - angle[0] == pytest.approx(2 * np.pi) and time[0] == time[-1]
    pyplot.close("all")


def test_plot_tangent_with_a_border():
    from matplotlib import pyplot

    V, F = dmkcl.surfaces.torus(n_triangles=4000)
    part = F[~(V[F][:, :, 0] < -2.5).all(axis=1)]
    axes = dmkcl.CutLocus(V, part).solve(point=(3, 0, 0)).plot_tangent()
    assert np.isnan(axes.lines[0].get_xdata()).any()
    pyplot.close("all")


def test_plot_history(result):
    from matplotlib import pyplot

    axes = result.plot_history()
    steps, change = axes.lines[0].get_data()
    assert np.array_equal(change, result.history["change"])
    assert str(f"{result.certificate.lower:.7g}") in axes.get_title()
    axes.figure.canvas.draw()
    pyplot.close("all")
