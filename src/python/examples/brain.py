"""How far mass moves on a brain: W1 between two histograms on a cortical surface, with its bounds and the flux.

The surface is fsaverage5, which lies in the package nilearn: `pip install --no-deps nilearn`; nothing of it is imported.
"""

import base64
import gzip
import zlib
from importlib.metadata import distribution
from xml.etree import ElementTree

import numpy as np

import dmkcl

FOLDER = "nilearn/datasets/data/fsaverage5/"
TYPES = {"NIFTI_TYPE_FLOAT32": "<f4", "NIFTI_TYPE_INT32": "<i4"}


def gifti(name):
    """The arrays of a GIFTI file."""
    arrays = []
    path = distribution("nilearn").locate_file(FOLDER + name)
    for node in ElementTree.fromstring(gzip.open(path).read()).iter("DataArray"):
        raw = zlib.decompress(base64.b64decode(node.find("Data").text))
        shape = [int(node.get(f"Dim{k}")) for k in range(int(node.get("Dimensionality")))]
        arrays.append(np.frombuffer(raw, TYPES[node.get("DataType")]).reshape(shape))
    return arrays


vertices, faces = gifti("pial_left.gii.gz")
(depth,) = gifti("sulc_left.gii.gz")  # of the folds: positive in the valleys
(thickness,) = gifti("thick_left.gii.gz")
mesh = dmkcl.Mesh(vertices.astype(float), faces)
print(f"{len(mesh.vertices)} vertices, {len(mesh.faces)} triangles")

# Two histograms over the whole surface: from the ridges to the valleys, and from where the cortex is thick.
solver = dmkcl.CutLocus(mesh)
ridges, valleys = np.maximum(-depth, 0.0), np.maximum(depth, 0.0)
for name, mass in {"ridges": ridges, "thick parts": np.maximum(thickness - 2.5, 0.0)}.items():
    moved = solver.transport(mass / mass.sum(dtype=float), valleys, normalise=True)
    print(f"{name} to valleys: between {moved.lower:.4f} and {moved.upper:.4f} mm on average")

moved.write("brain.vtp")  # mu, flux (arrows, stream lines) and u for ParaView
