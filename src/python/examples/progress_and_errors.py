"""What happens on the way: progress, Ctrl-C, errors in words."""

import numpy as np

import dmkcl

solver = dmkcl.CutLocus(dmkcl.surfaces.sphere(n_triangles=5000))


# progress=True shows a bar by tqdm; a function gets each report.
def show(progress):
    if progress.stage == "solve":
        print(f"step {progress.step}: change {progress.change:.1e}, ends at {progress.tolerance:.1e}")


solver.solve(vertex=0, progress=show)


# Ctrl-C ends a solve after the running step, as does any exception of the function.
def stop(progress):
    if progress.step == 2:
        raise KeyboardInterrupt


try:
    solver.solve(vertex=0, progress=stop)
except KeyboardInterrupt:
    print("stopped; the solver can be used again:", solver.solve(vertex=0))

# Errors say what is wrong and where.
V, F = solver.mesh
for name, wrong in {
    "twisted": np.vstack([F[:1, ::-1], F[1:]]),
    "double": np.vstack([F, F[:1]]),
}.items():
    try:
        dmkcl.CutLocus(V, wrong)
    except dmkcl.MeshError as error:
        print(f"{name}: {error}")
try:
    solver.solve(vertex=0, max_steps=1)
except dmkcl.StepLimitError as error:
    print(error)
