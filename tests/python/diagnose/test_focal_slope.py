# SPDX-License-Identifier: Apache-2.0
"""The change by a longer focal length, where dots are hardly wider than a pixel."""

from dataclasses import replace

import numpy as np
import pytest

from activestereo.effects.core.resample import SupersampledImages
from activestereo.effects.core.laws import example_view
from activestereo.diagnose.geometry import focal_slopes
from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.nuisances import Nuisances
from activestereo.effects.core.view import Layers

# Dots 2.9 pixels apart, as in the benchmark suite's worlds: radians of phase per unit of a direction's tangent.
PHASE = 130.0
MARGIN_PX = 4


def pixel_means(view, focal_px, scale=1, margin_px=0):
    """The picture [height][width], 1 + cos(PHASE x) cos(PHASE y): means over squares, `scale` a pixel's side, margin_px
    pixels beyond the frame."""
    sinc = np.sinc(PHASE / focal_px / scale / (2 * np.pi))
    wave = []
    for size, middle in zip(view.shape, (view.K[1, 2], view.K[0, 2]), strict=True):
        at = (np.arange((size + 2 * margin_px) * scale) + 0.5) / scale - 0.5 - margin_px
        wave.append(sinc * np.cos(PHASE * (at - middle) / focal_px))
    return 1.0 + wave[0][:, None] * wave[1]


@pytest.mark.parametrize(("scale", "error"), [(2, 0.05), (1, 0.5)])
def test_the_slope_along_the_focal_length_is_that_of_finer_images(scale, error):
    view = replace(example_view(), frame=replace(example_view().frame, exposure_s=1.0, gain=1.0))
    focal_px, none = view.K[0, 0], np.zeros(view.shape, np.float32)
    dots = pixel_means(view, focal_px).astype(np.float32)
    layers = Layers(dots, none, none, dots, none, none, none)
    if scale > 1:
        supersampled = pixel_means(view, focal_px, scale, MARGIN_PX).astype(np.float32)
        images = SupersampledImages(
            np.stack([supersampled, 0 * supersampled, 0 * supersampled, supersampled]), scale, MARGIN_PX
        )
        layers = Layers(dots, none, none, dots, none, none, none, supersampled=images)
    shot = MeasuredImage(view.frame, view.side, view, layers, dots)
    slope = focal_slopes([shot], Nuisances(40.0, 0.0, 4.0))[shot.key]
    step = 1e-4
    truth = 40.0 * (pixel_means(view, focal_px * (1 + step)) - pixel_means(view, focal_px * (1 - step))) / (2 * step)
    assert np.std(slope - truth) < error * np.std(truth)
