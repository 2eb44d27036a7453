"""A colour map for densities whose equal steps look equal: pale for small, dark blue for large."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Oklab (B. Ottosson, "A perceptual color space for image processing", 2020): to the cube roots of
# the cones' answers, and from the answers to linear sRGB.
_TO_CONES = np.array(
    [
        [1, 0.3963377774, 0.2158037573],
        [1, -0.1055613458, -0.0638541728],
        [1, -0.0894841775, -1.2914855480],
    ]
)
_TO_RGB = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


def to_rgb(lab: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) Oklab colours as sRGB; outside of [0, 1] where a screen cannot show them."""
    linear = (lab @ _TO_CONES.T) ** 3 @ _TO_RGB.T
    curve = 1.055 * np.abs(linear) ** (1 / 2.4) - 0.055
    shown: NDArray[np.float64] = np.where(linear <= 0.0031308, 12.92 * linear, curve)
    return shown


def density_map(n: int = 256) -> NDArray[np.float64]:
    """(n, 3) sRGB in [0, 1]. The lightness falls evenly while the hue turns from yellow over green
    to blue, so that the order of the colours is seen, by the colour-blind and in grey too."""
    t = np.linspace(0, 1, n)
    lightness = 0.97 - 0.69 * t
    hue = np.radians(100 + 170 * t)
    chroma = 0.085 - 0.05 * (1 - t) ** 3  # what a screen can show at every t
    return to_rgb(np.column_stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)]))
