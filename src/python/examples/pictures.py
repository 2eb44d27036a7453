"""The four pictures of a result. Without `screenshot`, plot() opens a window."""

from matplotlib import pyplot

import dmkcl

ellipsoid = dmkcl.surfaces.ellipsoid(0.6, 0.8, 1, n_triangles=20000)
result = dmkcl.CutLocus(ellipsoid).solve(point=(0.6, 0.1, 0.2), gap=1e-3)

result.plot(screenshot="surface.png")
result.plot_tangent()
pyplot.savefig("tangent.png")
pyplot.figure()
result.plot_history()
pyplot.savefig("history.png")
result.export_html("surface.html", title="Ellipsoid with the axes 0.6, 0.8, 1")
print("the cut locus of an ellipsoid is one arc:", result.locus)
