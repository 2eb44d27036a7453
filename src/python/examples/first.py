"""The cut locus of a point on a torus, and a page that shows it in a browser."""

import dmkcl

surface = dmkcl.surfaces.torus(refine=1)
result = dmkcl.CutLocus(surface).solve(point=(3, 0, 0))
print(result.locus)
print(f"integral of the distance: {result.stats['cost_exact']:.6g}")
print(
    f"cost of the discrete problem: between {result.certificate.lower:.6g} and "
    f"{result.certificate.upper:.6g}"
)
result.export_html("torus.html")
