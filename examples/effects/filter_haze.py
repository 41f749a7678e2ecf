# SPDX-License-Identifier: Apache-2.0
from activestereo.effects import Parameter, Stage, effect


@effect("filter_haze", stage=Stage.OPTICS, family="glare", source="my bench, May",
        parameters=[Parameter("fraction", unit="1", neutral=0.0, low=0.0, high=0.3, typical=0.05)])
def filter_haze(image, view, fraction):
    """A hazy filter spreads a fraction of all light evenly over the picture."""
    return (1 - fraction) * image + fraction * image.mean(axis=(-2, -1), keepdims=True)
