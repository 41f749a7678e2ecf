# SPDX-License-Identifier: Apache-2.0
"""The point cloud of `activestereo view` in a browser's WebGL: where its points are drawn, and how it turns."""

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from chromium import needs_chromium
from view_page import View

pytestmark = needs_chromium


@pytest.fixture(scope="module")
def view(lab_world):
    with View(lab_world.capture_path) as view:
        if not view.page.value("cloud.gl !== null"):
            pytest.skip("this chromium has no WebGL")
        yield view


def pixels(view):
    """The canvas as it is drawn, uint8 [height][width][3]."""
    script = """(() => { const c = document.getElementById('cloud'), copy = document.createElement('canvas');
        [copy.width, copy.height] = [c.width, c.height]; const context = copy.getContext('2d');
        context.drawImage(c, 0, 0);
        return [c.width, c.height, ...context.getImageData(0, 0, c.width, c.height).data]; })()"""
    width, height, *values = view.page.value(script)
    return np.array(values, np.uint8).reshape(height, width, 4)[..., :3].astype(int)


def is_marked(image):
    """Pixels of the pointer's red."""
    return (image[..., 0] > 200) & (image[..., 1] < 90) & (image[..., 2] < 60)


def turned(view):
    return [float(value) for value in view.page.value("document.getElementById('cloud').dataset.shown").split()]


def test_points_are_those_of_the_disparity(view, lab_world):
    capture = read_capture(lab_world.capture_path)
    points = np.array(view.page.value("[...pictures.measured.points]")).reshape(-1, 4)
    counted = "document.getElementById('cloud').dataset.%s"
    assert len(points) == view.page.value("pictures.measured.images.disparity.filter((d) => d > 0).length")
    assert int(view.page.value(counted % "measured")) == len(points)
    k, focal_baseline = capture.rig.left.K, capture.rig.left.K[0, 0] * capture.rig.baseline_m
    disparity = np.array(view.page.value("[...pictures.measured.images.disparity].map((d) => d > 0 ? d : 0)"))
    seen = np.flatnonzero(disparity)
    v, u = np.divmod(seen, capture.rig.left.width)
    z = focal_baseline / disparity[seen]
    rays = np.linalg.solve(k, np.stack([u, v, np.ones(len(u))]))
    assert np.allclose(points[:, :3], (rays * z).T, rtol=1e-4, atol=1e-5)


def test_the_cloud_is_seen_as_the_camera_sees_it(view, lab_world):
    """A pixel's mark lies where a pinhole at the camera's place draws it."""
    rig = read_capture(lab_world.capture_path).rig
    view.page.click("#clouds [data-cloud=measured]")
    view.page.click("#cloud", count=2)
    disparity = "pictures.measured.images.disparity"
    for share in (0.35, 0.6):
        u, v = view.page.value(f"""(() => {{ const from = Math.floor({share} * {disparity}.length);
            const i = from + {disparity}.slice(from).findIndex((d) => d > 0);
            return [i % facts.width, Math.floor(i / facts.width)]; }})()""")  # fmt: skip
        view.point(u, v)
        image = pixels(view)
        rows, columns = np.nonzero(is_marked(image))
        assert rows.size > 20
        scale = 1.9 * image.shape[0] / 2  # pixels of the canvas for a tangent of 1
        tangent = np.linalg.solve(rig.left.K, [u, v, 1.0])
        expected = image.shape[1] / 2 + scale * tangent[0], image.shape[0] / 2 + scale * tangent[1]
        assert (columns.mean(), rows.mean()) == pytest.approx(expected, abs=2.0)


def test_dragging_and_keys_turn_it_and_the_wheel_comes_nearer(view):
    view.page.click("#cloud", count=2)
    first, before = turned(view), pixels(view)
    view.page.drag("#cloud", 75, -30)
    assert turned(view) == pytest.approx([first[0] + 0.5, first[1] - 0.2, first[2]], abs=1e-3)
    assert (np.abs(pixels(view) - before).max(axis=2) > 20).mean() > 0.05
    view.page.value("document.getElementById('cloud').focus()")
    view.key("ArrowLeft")
    view.page.wheel("#cloud", -480, 0.5, 0.5)
    view.page.wait(f"Number(cloud.distance.toFixed(3)) === {round(first[2] / 2, 3)}")
    assert turned(view)[0] == pytest.approx(first[0] + 0.4, abs=1e-3)
    view.key("0")
    assert turned(view) == first


def test_measured_and_simulated_points_are_shown_as_chosen(view):
    view.page.click("#cloud", count=2)
    counts = "[cloud.clouds.measured.count, cloud.clouds.simulated.count]"
    shown = {}
    for name in ("measured", "simulated", "both"):
        view.page.click(f"#clouds [data-cloud={name}]")
        shown[name] = view.page.value(counts)
    assert shown["measured"][1] == shown["simulated"][0] == 0
    assert shown["both"] == [shown["measured"][0], shown["simulated"][1]]
    assert min(shown["both"]) > 1000


def test_a_slider_moves_the_points(view):
    """A longer baseline moves what is seen nearer, as the matcher then tells it."""
    view.page.click("#clouds [data-cloud=simulated]")

    def depth():
        """The points' distances by pixel; NaN where there is none."""
        seen = np.array(view.page.value("[...pictures.simulated.images.disparity].map((d) => d > 0)"), bool)
        z = np.full(len(seen), np.nan)
        z[seen] = view.page.value("[...pictures.simulated.points.filter((p, i) => i % 4 === 2)]")
        return z

    before = depth()
    view.page.value("document.getElementById('view').dataset.shown = ''; panel._add('baseline_drift')")
    view.wait()
    drift = view.page.value("panel.settings().effects.baseline_drift.offset_m")
    after = depth()
    view.page.value("document.getElementById('view').dataset.shown = ''; document.getElementById('reset').click()")
    view.wait()
    assert np.nanmedian(after / before) - 1.0 == pytest.approx(-drift / 0.05, rel=0.25)
    assert drift != 0.0
